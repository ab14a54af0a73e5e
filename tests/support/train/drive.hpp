// How a simulated train really runs: starts, stops and speeds as they come, jerk-limited.
#pragma once

#include <vector>

#include "core/random.hpp"

namespace railfix::train {

/// Truth at one time; metres along the path since the start.
struct Motion {
  double distance_m = 0;
  double speed_mps = 0;
  double acceleration_mps2 = 0;
};

class Drive {
 public:
  /// Up to max_speed_mps, changing its target every 10 to 40 s, a quarter of them stops. Ends standing before
  /// max_way_m.
  Drive(core::Random& random, double duration_s, double max_speed_mps = 42, double max_way_m = 1e9);

  [[nodiscard]] Motion at(double t_s) const;
  [[nodiscard]] double way_m() const { return samples_.back().distance_m; }
  [[nodiscard]] double duration_s() const;
  /// First time at which the train has run so far; duration_s() when it never does.
  [[nodiscard]] double time_at(double distance_m) const;

 private:
  std::vector<Motion> samples_;
};

}  // namespace railfix::train
