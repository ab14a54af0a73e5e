// Faults that meet each other: one after the other at random, without waiting until the train is whole again.
#pragma once

#include <functional>

#include "system/observer.hpp"
#include "system/rig.hpp"

namespace railfix::system_test {

struct RandomFaults {
  double minutes = 10;
  unsigned seed = 1;
  double every_s = 3;  // on average
};

/// `depart` begins the ride anew, `ride_s` long. 0 = no confident wrong position, and no report lost.
int random_faults(Rig& rig, std::unique_ptr<Observer>& observer, const RandomFaults& options, double ride_s,
                  const std::function<void()>& depart);

}  // namespace railfix::system_test
