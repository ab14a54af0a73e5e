// Conversions at the edges of the system; inside everything is SI and radians.
#pragma once

#include <cmath>
#include <numbers>

namespace railfix::core {

constexpr double kPi = std::numbers::pi;
constexpr double kGravityMps2 = 9.80665;

constexpr double rad_from_deg(double deg) {
  return deg * kPi / 180.0;
}
constexpr double deg_from_rad(double rad) {
  return rad * 180.0 / kPi;
}
constexpr double mps_from_kmh(double kmh) {
  return kmh / 3.6;
}
constexpr double kmh_from_mps(double mps) {
  return mps * 3.6;
}

/// The same angle in (-pi, pi].
inline double wrap_pi(double angle_rad) {
  const double wrapped = std::remainder(angle_rad, 2.0 * kPi);
  return wrapped <= -kPi ? kPi : wrapped;
}

}  // namespace railfix::core
