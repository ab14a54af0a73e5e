// One simulated run through the real fusion, judged against the truth.
#pragma once

#include <functional>
#include <vector>

#include "support/train/simulation.hpp"

namespace railfix::train {

struct Verdict {
  double way_m = 0;
  size_t states = 0;
  size_t outside = 0;           // true position not in [estimate - over, estimate + under]
  double worst_excess_m = 0;    // so far outside
  size_t outside_ok = 0;        // ... while the state says ok
  size_t outside_usable = 0;    // ... ok or degraded
  size_t outside_again = 0;     // ... since it claimed no place on the map
  size_t placeless = 0;         // claims none
  size_t wider_of_last = 0;     // interval beyond 5 m + 5 % of the way since the last reference, sure or not
  size_t wider = 0;             // ... since the last sure one, as fusion judges itself ...
  size_t wider_unsaid = 0;      // ... while the state says ok
  size_t wider_placeless = 0;   // ... while it claims no place on the map
  size_t wider_first = 0;       // ... before the first reference: no landmark has confirmed the place that was told
  size_t wider_alone = 0;       // ... while it names nothing else that is wrong
  size_t not_ok = 0;            // degraded or unusable
  size_t told = 0;              // states that name the faulty sensor while its fault lasts
  size_t other_leg = 0;         // states on a leg that the train did not take ...
  size_t other_leg_sure = 0;    // ... while they say ok and that the track is declared
  double other_leg_sure_s = 0;  // so long at most, without a break ...
  double other_leg_sure_m = 0;  // ... and over so much of the way
  double width_sum_m = 0;       // over + under
  std::vector<float> errors_m;  // absolute, of every state after `after_m`

  void add(const Verdict& other);
};

/// Sees every state with its signed error (m).
using Watcher = std::function<void(const fusion::TrainEstimate&, double error_m)>;

/// REQUIRES: fusion was made for simulation.map and simulation.start(). With place_known = false the distance run is
/// judged instead of the place.
Verdict judge(const TrainSimulation& simulation, fusion::Fusion& fusion, double after_m = 0,
              const Watcher& watcher = {});

/// 0 when there are none; reorders them.
double quantile(std::vector<float>& values, double share);

}  // namespace railfix::train
