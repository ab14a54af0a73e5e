// Steps and headings in the plane of the map: easting, northing; clockwise from grid north.
#pragma once

#include <Eigen/Core>
#include <cmath>

namespace railfix::track {

inline double heading_of(const Eigen::Vector2d& step) {
  return std::atan2(step.x(), step.y());
}

/// One metre that way.
inline Eigen::Vector2d direction_of(double heading_rad) {
  return {std::sin(heading_rad), std::cos(heading_rad)};
}

/// Positive where b is to the left of a.
inline double cross(const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
  return a.x() * b.y() - a.y() * b.x();
}

}  // namespace railfix::track
