// Memory and latency of every service over a long ride.
#pragma once

#include "system/observer.hpp"

namespace railfix::system_test {

/// Prints a table at the end and every ten minutes. 0 when neither memory nor latency grows.
int soak(Rig& rig, Observer& observer, double minutes);

}  // namespace railfix::system_test
