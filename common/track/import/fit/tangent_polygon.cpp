#include "track/import/fit/tangent_polygon.hpp"

#include <algorithm>
#include <cmath>

#include "core/units.hpp"
#include "track/import/fit/plane.hpp"

namespace railfix::track {
namespace {

constexpr double kShareOfTangent = 0.45;
constexpr double kLeastTurnRad = 1e-6;

/// Clothoid, arc, clothoid for one corner, and how far along the tangents it begins and ends.
struct Curve {
  double curvature_per_m = 0;
  double transition_m = 0;
  double arc_m = 0;
  double tangent_m = 0;
};

/// `turn_rad` is positive to the left.
Curve curve_for(double turn_rad, double radius_m, double transition_m, double room_m) {
  const double turn = std::abs(turn_rad);
  // At least a third of the turn is left to the arc.
  double transition = std::min(transition_m, 2.0 / 3.0 * turn * radius_m);
  const double half = 0.5 * transition / radius_m;
  const PlanPose end = advance({}, {transition, 0, 1.0 / radius_m}, transition);
  const double along = end.northing_m - radius_m * std::sin(half);
  const double aside = -end.easting_m + radius_m * std::cos(half);
  const double tangent = along + aside * std::tan(0.5 * turn);
  const double scale = std::min(1.0, room_m / tangent);
  const double radius = scale * radius_m;
  return {std::copysign(1.0 / radius, turn_rad), scale * transition, radius * (turn - 2.0 * half), scale * tangent};
}

}  // namespace

RoundedPolygon round_corners(const Eigen::Vector2d& begin, const std::vector<Corner>& corners,
                             const Eigen::Vector2d& end) {
  RoundedPolygon out;
  const auto add = [&](const PlanPose& start, const Element& element) {
    if (element.length_m < 1e-6) return start;
    out.elements.push_back(element);
    out.starts.push_back(start);
    out.length_m += element.length_m;
    return advance(start, element, element.length_m);
  };
  const auto add_straight = [&](const Eigen::Vector2d& from, const Eigen::Vector2d& to) {
    const double length = (to - from).norm();
    add({from.x(), from.y(), heading_of(to - from)}, {length, 0, 0});
    out.straights.push_back({out.length_m - length, out.length_m});
  };
  Eigen::Vector2d reached = begin;
  for (size_t i = 0; i < corners.size(); ++i) {
    const Eigen::Vector2d& at = corners[i].at;
    const Eigen::Vector2d in = at - (i == 0 ? begin : corners[i - 1].at);
    const Eigen::Vector2d leaving = (i + 1 == corners.size() ? end : corners[i + 1].at) - at;
    const double turn = -core::wrap_pi(heading_of(leaving) - heading_of(in));
    if (std::abs(turn) < kLeastTurnRad) continue;
    const Curve curve = curve_for(turn, corners[i].radius_m, corners[i].transition_m,
                                  kShareOfTangent * std::min(in.norm(), leaving.norm()));
    const Eigen::Vector2d from = at - curve.tangent_m * in.normalized();
    add_straight(reached, from);
    PlanPose pose{from.x(), from.y(), heading_of(in)};
    pose = add(pose, {curve.transition_m, 0, curve.curvature_per_m});
    pose = add(pose, {curve.arc_m, curve.curvature_per_m, curve.curvature_per_m});
    add(pose, {curve.transition_m, curve.curvature_per_m, 0});
    reached = at + curve.tangent_m * leaving.normalized();
  }
  add_straight(reached, end);
  return out;
}

std::vector<Corner> parallel_corners(const Eigen::Vector2d& begin, const std::vector<Corner>& corners,
                                     const Eigen::Vector2d& end, double left_m) {
  std::vector<Corner> out = corners;
  for (size_t i = 0; i < corners.size(); ++i) {
    const Eigen::Vector2d& at = corners[i].at;
    const double in = heading_of(at - (i == 0 ? begin : corners[i - 1].at));
    const double turn = core::wrap_pi(heading_of((i + 1 == corners.size() ? end : corners[i + 1].at) - at) - in);
    const Eigen::Vector2d left = direction_of(in + 0.5 * turn - 0.5 * core::kPi);
    out[i].at += left_m / std::cos(0.5 * turn) * left;
    out[i].radius_m += turn > 0 ? left_m : -left_m;  // a right curve is outside on the left
  }
  return out;
}

}  // namespace railfix::track
