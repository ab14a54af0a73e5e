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

/// How the driver takes a new speed.
struct DriveStyle {
  double traction_mps2 = 0.7;
  double brake_mps2 = 0.9;
  double jerk_mps3 = 0.6;
  double gain_per_s = 0.5;  // acceleration per missing speed
  double back_mps = 0;      // it sets back now and then, so fast at most; 0: it never does

  /// Full traction or brake from one moment to the next and until the speed is there, as an emergency brake to the
  /// stop.
  static DriveStyle sudden(double mps2) { return {mps2, mps2, 1000, 10, 0}; }
};

class Drive {
 public:
  /// Up to max_speed_mps, changing its target every 10 to 40 s, a quarter of them stops, and a third backwards where
  /// it sets back. Ends standing before max_way_m, and stays before where it began.
  Drive(core::Random& random, double duration_s, double max_speed_mps, double max_way_m, const DriveStyle& style);

  [[nodiscard]] Motion at(double t_s) const;
  [[nodiscard]] double way_m() const { return samples_.back().distance_m; }
  [[nodiscard]] double duration_s() const;
  /// First time at which the train has run so far; duration_s() when it never does.
  [[nodiscard]] double time_at(double distance_m) const;

 private:
  std::vector<Motion> samples_;
};

}  // namespace railfix::train
