// How things beside a curved track look from a camera that looks along it.
#pragma once

#include <cmath>

namespace railfix::track_detector {

/// Bearing of a place so far on along the track and beside it.
inline double bearing_of(double along_m, double lateral_m, double curvature_per_m) {
  if (curvature_per_m == 0) return lateral_m / along_m;
  const double radius_m = 1 / curvature_per_m;
  const double turn = curvature_per_m * along_m;
  return (radius_m - (radius_m - lateral_m) * std::cos(turn)) / ((radius_m - lateral_m) * std::sin(turn));
}

}  // namespace railfix::track_detector
