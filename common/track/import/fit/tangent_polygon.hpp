// Alignments as they are designed: a polygon of tangents whose corners are rounded by clothoid, arc and clothoid.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "track/alignment.hpp"

namespace railfix::track {

struct Corner {
  Eigen::Vector2d at = Eigen::Vector2d::Zero();
  double radius_m = 0;
  double transition_m = 0;  // length of each clothoid
};

/// A stretch without curvature, by offset.
struct StraightStretch {
  double from_m = 0;
  double to_m = 0;
};

struct RoundedPolygon {
  std::vector<Element> elements;
  std::vector<PlanPose> starts;
  std::vector<StraightStretch> straights;
  double length_m = 0;
};

/// From `begin` over the corners to `end`; begins and ends on the first and last tangent to rounding. Where a curve
/// would need more than 45 % of a tangent on either side it is made smaller, keeping its shape.
/// REQUIRES: neighbours apart, no corner that turns by more than 170 degrees.
RoundedPolygon round_corners(const Eigen::Vector2d& begin, const std::vector<Corner>& corners,
                             const Eigen::Vector2d& end);

/// The polygon moved to the left by `left_m`; radii follow, so that both tracks stay parallel in curves.
std::vector<Corner> parallel_corners(const Eigen::Vector2d& begin, const std::vector<Corner>& corners,
                                     const Eigen::Vector2d& end, double left_m);

}  // namespace railfix::track
