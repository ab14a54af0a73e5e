#include "track_detector/upright_objects.hpp"

#include <algorithm>
#include <cmath>

namespace railfix::track_detector {
namespace {

constexpr double kForgetM = 12;  // edges this far behind the camera
constexpr double kMastWidthM[] = {0.06, 0.55};
constexpr double kMastLateralM[] = {2.0, 9.0};
constexpr double kMastDepthM = 0.6;  // its edges may stand so far from each other along the track
constexpr double kTunnelWidthM[] = {3.6, 12.0};
constexpr double kBridgeWidthM[] = {6.0, 28.0};
constexpr double kSidesM = 1.0;         // both sides stand at one place
constexpr double kDarkShare = 0.8;      // of the outer brightness
constexpr double kObjectSigmaM = 0.05;  // of where the surveyor's point of an object is
constexpr double kWorstSigmaM = 0.35;
constexpr double kWorstEdgeM = 0.8;
constexpr double kSamePortalM = 25;
constexpr double kHoldM = 1.0;

bool between(double value, const double (&range)[2]) {
  return value >= range[0] && value <= range[1];
}

}  // namespace

void UprightObjects::forget() {
  edges_.clear();
  held_.clear();
  last_mast_m_ = last_portal_m_ = last_bridge_m_ = -1e9;
}

const std::vector<UprightObject>& UprightObjects::add(const std::vector<SettledEdge>& edges, double way_m) {
  objects_.clear();
  for (const SettledEdge& edge : edges) {
    if (edge.sigma_m < kWorstEdgeM) edges_.push_back({edge, false});
  }
  if (!edges.empty()) {
    pair_masts();
    pair_sides();
  }
  release(way_m);
  std::erase_if(edges_, [way_m](const Edge& e) { return e.edge.place_m < way_m - kForgetM; });
  return objects_;
}

// A mast is darker or brighter than what is on both its sides.
void UprightObjects::pair_masts() {
  for (Edge& a : edges_) {
    for (Edge& b : edges_) {
      if (a.used || b.used || a.edge.lateral_m >= b.edge.lateral_m) continue;
      if (std::min(a.edge.sigma_m, b.edge.sigma_m) > kWorstSigmaM) continue;
      const double width_m = b.edge.lateral_m - a.edge.lateral_m;
      const double middle_m = 0.5 * (a.edge.lateral_m + b.edge.lateral_m);
      const bool left = middle_m > 0;
      const SettledEdge& inner = left ? a.edge : b.edge;
      const SettledEdge& outer = left ? b.edge : a.edge;
      const double step_in = inner.outer_grey - inner.inner_grey;
      const double step_out = outer.outer_grey - outer.inner_grey;
      if (!between(width_m, kMastWidthM) || !between(std::abs(middle_m), kMastLateralM) || step_in * step_out > 0)
        continue;
      if (std::abs(a.edge.place_m - b.edge.place_m) > kMastDepthM) continue;
      a.used = b.used = true;
      const double wa = 1 / (a.edge.sigma_m * a.edge.sigma_m);
      const double wb = 1 / (b.edge.sigma_m * b.edge.sigma_m);
      const double place_m = (wa * a.edge.place_m + wb * b.edge.place_m) / (wa + wb);
      // The edges err together: no gain from the second one.
      objects_.push_back({LandmarkType::mast, place_m, middle_m,
                          std::hypot(std::min(a.edge.sigma_m, b.edge.sigma_m), kObjectSigmaM),
                          std::min(a.edge.pictures, b.edge.pictures)});
      last_mast_m_ = place_m;
    }
  }
}

void UprightObjects::pair_sides() {
  for (Edge& left : edges_) {
    for (Edge& right : edges_) {
      if (left.used || right.used || left.edge.lateral_m < 1 || right.edge.lateral_m > -1) continue;
      if (std::abs(left.edge.place_m - right.edge.place_m) > kSidesM) continue;
      const double width_m = left.edge.lateral_m - right.edge.lateral_m;
      const bool dark = left.edge.inner_grey < kDarkShare * left.edge.outer_grey &&
                        right.edge.inner_grey < kDarkShare * right.edge.outer_grey;
      const bool bright = left.edge.outer_grey < kDarkShare * left.edge.inner_grey &&
                          right.edge.outer_grey < kDarkShare * right.edge.inner_grey;
      UprightObject object{LandmarkType::bridge, 0.5 * (left.edge.place_m + right.edge.place_m), 0,
                           std::hypot(std::max(left.edge.sigma_m, right.edge.sigma_m), kObjectSigmaM),
                           std::min(left.edge.pictures, right.edge.pictures)};
      if (between(width_m, kTunnelWidthM) && (dark || bright)) {
        object.type = dark ? LandmarkType::portal_in : LandmarkType::portal_out;
      } else if (!between(width_m, kBridgeWidthM)) {
        continue;
      }
      left.used = right.used = true;
      hold(object);
    }
  }
}

// A portal's outer corners look like a bridge and come first; in a tunnel each panel looks like the exit.
void UprightObjects::hold(const UprightObject& object) {
  for (UprightObject& held : held_) {
    if (std::abs(held.place_m - object.place_m) > kForgetM) continue;
    const bool held_is_bridge = held.type == LandmarkType::bridge;
    const bool is_bridge = object.type == LandmarkType::bridge;
    if (held_is_bridge && !is_bridge) held = object;
    if (held_is_bridge || is_bridge) return;
    if (held.type == LandmarkType::portal_out && object.type == LandmarkType::portal_out &&
        object.place_m > held.place_m) {
      held = object;
    }
    return;
  }
  held_.push_back(object);
}

void UprightObjects::release(double way_m) {
  for (const UprightObject& held : held_) {
    if (held.place_m > way_m + kHoldM) continue;
    double& last_m = held.type == LandmarkType::bridge ? last_bridge_m_ : last_portal_m_;
    if (held.place_m - last_m < kSamePortalM && held.type != LandmarkType::portal_out) continue;
    last_m = held.place_m;
    objects_.push_back(held);
  }
  std::erase_if(held_, [way_m](const UprightObject& held) { return held.place_m <= way_m + kHoldM; });
}

}  // namespace railfix::track_detector
