// Points of a hand-drawn polyline moved a little, so that the track through them bends evenly.
#pragma once

#include <Eigen/Core>
#include <vector>

namespace railfix::track {

/// The line whose curvature changes least along its length (a clothoid has no cost beyond its steady change) while no
/// point moves by more than `limit_m`; first and last stay. Least squares with third differences over the chord
/// lengths. Fewer than five points, or a limit of 0, come back as they are. REQUIRES: neighbours at least 1 cm apart.
std::vector<Eigen::Vector2d> smoothed(const std::vector<Eigen::Vector2d>& points, double limit_m);

}  // namespace railfix::track
