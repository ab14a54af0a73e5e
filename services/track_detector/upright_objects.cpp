#include "track_detector/upright_objects.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

namespace railfix::track_detector {
namespace {

constexpr double kForgetM = 12;                 // edges this far behind the camera
constexpr double kMastSizeM[] = {0.155, 0.60};  // of its side or front; posts of lamps and boards are thinner
constexpr double kMastLateralM[] = {2.0, 9.0};
constexpr double kTunnelWidthM[] = {3.6, 12.0};
constexpr double kBridgeWidthM[] = {6.0, 28.0};
constexpr double kSidesM = 1.0;      // both sides stand at one place
constexpr double kDarkShare = 0.93;  // of the outer brightness
constexpr double kDeepShare = 0.5;
constexpr double kSameWallM = 0.3;
constexpr double kMouthM = 8;
constexpr double kExitSigmaM = 0.4;
constexpr double kOneSideSigmaM = 0.2;
constexpr double kDaylightShare = 0.8;  // of the brightness in front of the tunnel
constexpr double kObjectSigmaM = 0.05;  // of where the surveyor's point of an object is
constexpr double kSameMastM = 1.5;
constexpr double kSameBridgeM = 15;
constexpr double kWorstSigmaM = 0.35;
constexpr double kWorstEdgeM = 0.8;
constexpr double kLongestTunnelM = 500;  // a portal out may be missed
constexpr double kHoldM = 1.0;
constexpr size_t kUsuallyHeld = 200;

// Size of a thing from the bearings of its two edges in the same pictures: its front looks smaller with the distance,
// its side with the distance squared. Errors of the pose move both edges alike.
std::optional<double> size_of(const SettledEdge& a, const SettledEdge& b) {
  const double place_m = 0.5 * (a.place_m + b.place_m);
  const double lateral_m = 0.5 * std::abs(a.lateral_m + b.lateral_m);
  double n = 0, x = 0, y = 0, xx = 0, xy = 0;
  size_t k = 0;
  for (size_t i = 0; i < a.count; ++i) {
    while (k < b.count && b.measured[k].way_m < a.measured[i].way_m) ++k;
    if (k == b.count || b.measured[k].way_m > a.measured[i].way_m) continue;
    const double ahead_m = place_m - a.measured[i].way_m;
    const double seen_m = std::abs(b.measured[k].bearing - a.measured[i].bearing) * ahead_m;
    const double side = lateral_m / ahead_m;
    const double weight = 1 / (ahead_m * ahead_m);
    n += weight;
    x += weight * side;
    y += weight * seen_m;
    xx += weight * side * side;
    xy += weight * side * seen_m;
  }
  const double spread = n * xx - x * x;
  if (!(n > 0) || spread < 1e-4 * n * n) return std::nullopt;
  const double side_m = std::max(0.0, (n * xy - x * y) / spread);
  const double front_m = std::max(0.0, (y - side_m * x) / n);
  return std::hypot(front_m, side_m);
}

bool between(double value, const double (&range)[2]) {
  return value >= range[0] && value <= range[1];
}

}  // namespace

UprightObjects::UprightObjects() {
  edges_.reserve(kUsuallyHeld);
  held_.reserve(kUsuallyHeld);
  objects_.reserve(kUsuallyHeld);
}

void UprightObjects::forget() {
  edges_.clear();
  held_.clear();
  inside_since_m_ = last_bridge_m_ = last_mast_m_ = -1e9;
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

// A mast is darker or brighter than what is on both its sides; so is a post, which is thinner.
void UprightObjects::pair_masts() {
  while (true) {
    Edge* best_a = nullptr;
    Edge* best_b = nullptr;
    double smallest_m = kMastSizeM[1];
    for (Edge& a : edges_) {
      for (Edge& b : edges_) {
        if (a.used || b.used || &a == &b || a.edge.lateral_m > b.edge.lateral_m ||
            a.edge.lateral_m * b.edge.lateral_m < 0)
          continue;
        const double sign = a.edge.lateral_m > 0 ? 1 : -1;
        const double step_a = sign * (a.edge.outer_grey - a.edge.inner_grey);
        const double step_b = sign * (b.edge.outer_grey - b.edge.inner_grey);
        if (step_a * step_b > 0 || std::abs(a.edge.place_m - b.edge.place_m) > kMastSizeM[1] ||
            b.edge.lateral_m - a.edge.lateral_m > kMastSizeM[1]) {
          continue;
        }
        const auto size_m = size_of(a.edge, b.edge);
        if (!size_m || *size_m >= smallest_m) continue;
        smallest_m = *size_m;
        best_a = &a;
        best_b = &b;
      }
    }
    if (best_a == nullptr) return;
    best_a->used = best_b->used = true;
    if (smallest_m >= kMastSizeM[0]) tell_mast(best_a->edge, best_b->edge);
  }
}

void UprightObjects::tell_mast(const SettledEdge& a, const SettledEdge& b) {
  const double lateral_m = 0.5 * (a.lateral_m + b.lateral_m);
  const double best_sigma_m = std::min(a.sigma_m, b.sigma_m);
  if (!between(std::abs(lateral_m), kMastLateralM) || best_sigma_m > kWorstSigmaM) return;
  const double wa = 1 / (a.sigma_m * a.sigma_m);
  const double wb = 1 / (b.sigma_m * b.sigma_m);
  const double place_m = (wa * a.place_m + wb * b.place_m) / (wa + wb);
  if (std::abs(place_m - last_mast_m_) < kSameMastM && lateral_m * last_mast_lateral_m_ > 0) return;
  last_mast_m_ = place_m;
  last_mast_lateral_m_ = lateral_m;
  // The edges err together: no gain from the second one.
  objects_.push_back({LandmarkType::mast, place_m, lateral_m, std::hypot(best_sigma_m, kObjectSigmaM),
                      std::min(a.pictures, b.pictures)});
}

void UprightObjects::pair_sides() {
  for (Edge& left : edges_) {
    for (Edge& right : edges_) {
      if (left.used || right.used || left.edge.lateral_m < 1 || right.edge.lateral_m > -1) continue;
      if (std::abs(left.edge.place_m - right.edge.place_m) > kSidesM) continue;
      const double width_m = left.edge.lateral_m - right.edge.lateral_m;
      const bool dark = left.edge.inner_grey < kDarkShare * left.edge.outer_grey &&
                        right.edge.inner_grey < kDarkShare * right.edge.outer_grey;
      // Behind a bridge there is daylight again.
      const bool deep = left.edge.deep_grey < kDeepShare * left.edge.outer_grey &&
                        right.edge.deep_grey < kDeepShare * right.edge.outer_grey;
      const bool bright = left.edge.outer_grey < kDarkShare * left.edge.inner_grey &&
                          right.edge.outer_grey < kDarkShare * right.edge.inner_grey &&
                          std::min(left.edge.inner_grey, right.edge.inner_grey) > kDaylightShare * daylight_grey_;
      UprightObject object{LandmarkType::bridge, 0.5 * (left.edge.place_m + right.edge.place_m), 0,
                           std::hypot(std::max(left.edge.sigma_m, right.edge.sigma_m), kObjectSigmaM),
                           std::min(left.edge.pictures, right.edge.pictures)};
      if (between(width_m, kTunnelWidthM) && ((dark && deep) || bright)) {
        object.type = dark ? LandmarkType::portal_in : LandmarkType::portal_out;
        // The last joint of the lining may have been taken for the exit.
        if (!dark) object.sigma_m = std::hypot(object.sigma_m, kExitSigmaM);
        object.outer_grey = std::min(left.edge.outer_grey, right.edge.outer_grey);
      } else if (!between(width_m, kBridgeWidthM)) {
        continue;
      }
      left.used = right.used = true;
      if (object.type == LandmarkType::portal_in) move_to_mouth(object, left.edge, right.edge);
      hold(object);
    }
  }
}

// A tunnel's panels look like its mouth, which comes first but may have been followed on one side only.
void UprightObjects::move_to_mouth(UprightObject& portal, const SettledEdge& left, const SettledEdge& right) const {
  const double place_m = portal.place_m;
  for (const Edge& e : edges_) {
    const SettledEdge& wall = e.edge.lateral_m > 0 ? left : right;
    if (std::abs(e.edge.lateral_m - wall.lateral_m) > kSameWallM ||
        e.edge.inner_grey > kDarkShare * e.edge.outer_grey) {
      continue;
    }
    if (e.edge.place_m > portal.place_m - kSidesM || e.edge.place_m < place_m - kMouthM) continue;
    portal.place_m = e.edge.place_m;
    portal.outer_grey = e.edge.outer_grey;
    portal.sigma_m = std::hypot(e.edge.sigma_m, kOneSideSigmaM);
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

bool UprightObjects::in_tunnel(double way_m) const {
  return way_m - inside_since_m_ < kLongestTunnelM;
}

void UprightObjects::release(double way_m) {
  for (const UprightObject& held : held_) {
    if (held.place_m > way_m + kHoldM) continue;
    const bool inside = in_tunnel(held.place_m);
    if (inside != (held.type == LandmarkType::portal_out)) continue;
    if (held.type == LandmarkType::portal_in) {
      inside_since_m_ = held.place_m;
      daylight_grey_ = held.outer_grey;
    }
    if (held.type == LandmarkType::portal_out) inside_since_m_ = -1e9;
    if (held.type == LandmarkType::bridge) {
      if (held.place_m - last_bridge_m_ < kSameBridgeM) continue;  // its far side
      last_bridge_m_ = held.place_m;
    }
    objects_.push_back(held);
  }
  std::erase_if(held_, [way_m](const UprightObject& held) { return held.place_m <= way_m + kHoldM; });
}

}  // namespace railfix::track_detector
