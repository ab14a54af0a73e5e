#include "track_detector/upright_objects.hpp"

#include <algorithm>
#include <cmath>

#include "track_detector/opening_fit.hpp"

namespace railfix::track_detector {
namespace {

constexpr double kForgetM = 12;                 // edges this far behind the camera
constexpr double kMastSizeM[] = {0.155, 0.60};  // of its side or front; posts of lamps and boards are thinner
constexpr double kMastLateralM[] = {2.0, 9.0};
constexpr double kUsualAheadM = 8;  // when both edges are seen
constexpr double kTunnelWidthM[] = {3.6, 12.0};
constexpr double kBridgeWidthM[] = {6.0, 28.0};
constexpr double kWallShare = 0.85;  // of the outer brightness
constexpr double kDeepShare = 0.5;
constexpr double kMouthM = 8;
constexpr double kRoofedShare =
    0.8;  // of the ground's brightness: under simulated roofs 0.29 to 0.72, between mere walls 0.96
constexpr double kNextPanelM = 4;
constexpr double kOpeningOffM = 0.5;   // both sides together from the mean of each its own
constexpr double kWallSigmaM = 0.03;   // of its lateral offset at the portal in
constexpr double kNearerAloneM = 2.0;  // way on which only one side shows, which tells more than both before
constexpr double kStripeRmsM = 0.03;
constexpr double kObjectSigmaM = 0.05;  // of where the surveyor's point of an object is
constexpr double kSameMastM = 1.5;
constexpr double kSameBridgeM = 15;
constexpr double kWorstSigmaM = 0.35;
constexpr double kWorstEdgeM = 0.8;
constexpr double kLongestTunnelM = 60000;  // the Gotthard's is 57 km; daylight ends one whose portal out was missed
constexpr double kOutM = 60;               // so long in daylight is no tunnel any more
constexpr size_t kUsuallyHeld = 200;
// Grey levels beside the track. An exposure that adapts shows open land by day at 50 to 120, a tunnel's lining in the
// headlamp's light at 25 to 60, open land at night below 22.
constexpr double kDaylightGrey = 40;
constexpr double kLitWallGrey = 20;
constexpr double kUsualGreyM = 40;  // of way that both are averaged over; longer than the face of a portal shows
constexpr double kNearGreyM = 6;
constexpr double kWaitM = 1.5;  // the other edge of a mast leaves the picture so much later, at most

// What stands behind a post must not be taken for a mast together with the post's far side.
bool is_far_side_of_post(const SettledEdge& edge) {
  const auto size = size_inward(edge);
  return size && size->largest_m() < kMastSizeM[0];
}

// Of two edges on one side, as they are seen in the same picture.
bool is_inner(const SettledEdge& a, const SettledEdge& b) {
  const double way_m = std::min(a.place_m, b.place_m) - kUsualAheadM;
  return a.lateral_m * b.lateral_m > 0 &&
         std::abs(a.lateral_m) / (a.place_m - way_m) < std::abs(b.lateral_m) / (b.place_m - way_m);
}

bool between(double value, const double (&range)[2]) {
  return value >= range[0] && value <= range[1];
}

}  // namespace

UprightObjects::UprightObjects() {
  edges_.reserve(kUsuallyHeld);
  held_.reserve(kUsuallyHeld);
  masts_.reserve(kUsuallyHeld);
  objects_.reserve(kUsuallyHeld);
}

void UprightObjects::forget() {
  edges_.clear();
  held_.clear();
  masts_.clear();
  exits_ = {};
  last_bridge_m_ = open_above_m_ = -1e9;
  tunnel_.left_unseen = in_tunnel(light_.way_m);
  if (tunnel_.left_unseen) {
    tunnel_.wall_sigma_m = {kSameWallM, kSameWallM};  // it may be another one
    return;
  }
  tunnel_ = {};
  light_ = {};
}

void UprightObjects::look_at_light(double beside_grey, double way_m) {
  if (!light_.known) light_ = {true, way_m, beside_grey, beside_grey, way_m};
  const double step_m = std::abs(way_m - light_.way_m);
  light_.way_m = way_m;
  light_.near_grey += (beside_grey - light_.near_grey) * (1 - std::exp(-step_m / kNearGreyM));
  if (tunnel_.left_unseen) {
    if (beside_grey > kOutShare * light_.usual_grey) tunnel_ = {};
    tunnel_.left_unseen = false;
  }
  if (!in_tunnel(way_m)) {
    light_.usual_grey += (beside_grey - light_.usual_grey) * (1 - std::exp(-step_m / kUsualGreyM));
  } else if (way_m - light_.tunnel_like_m > kOutM) {  // no tunnel, or its portal out was missed
    tunnel_ = {};
    exits_ = {};
  }
  if (!in_tunnel(way_m) || beside_grey < kOutShare * light_.usual_grey) light_.tunnel_like_m = way_m;
}

bool UprightObjects::daylight() const {
  return light_.usual_grey > kDaylightGrey;
}

bool UprightObjects::lit_walls() const {
  return !daylight() && light_.near_grey > kLitWallGrey;
}

const std::vector<UprightObject>& UprightObjects::add(const std::vector<SettledEdge>& edges, const EdgeTracker& tracker,
                                                      const GroundShade& shade, double way_m, double beside_grey) {
  objects_.clear();
  look_at_light(beside_grey, way_m);
  for (const SettledEdge& edge : edges) {
    if (lit_walls()) continue;  // of a tunnel at night, perhaps: lamps, niches, panels
    if (edge.sigma_m < kWorstEdgeM) edges_.push_back({edge, way_m});
    if (!in_tunnel(edge.place_m)) continue;
    follow_wall(edge);
    look_for_exit(edge);
  }
  if (!edges.empty()) {
    std::sort(edges_.begin(), edges_.end(),
              [](const Edge& a, const Edge& b) { return a.edge.sigma_m < b.edge.sigma_m; });
    pair_masts();
  }
  find_stripes(way_m);
  pair_sides(shade, way_m);
  release(way_m);
  release_exit(tracker, way_m, beside_grey);
  std::erase_if(edges_, [way_m](const Edge& e) { return e.edge.place_m < way_m - kForgetM; });
  std::erase_if(masts_, [way_m](const UprightObject& mast) { return mast.place_m < way_m - 2 * kForgetM; });
  return objects_;
}

// A mast is darker or brighter than what is on both its sides; so is a post, which is thinner.
void UprightObjects::pair_masts() {
  while (true) {
    Edge* best_inner = nullptr;
    Edge* best_outer = nullptr;
    MastSize best;
    double smallest_m = kMastSizeM[1];
    for (Edge& a : edges_) {
      for (Edge& b : edges_) {
        if (a.used || b.used || &a == &b || !is_inner(a.edge, b.edge)) continue;
        if ((a.edge.outer_grey > a.edge.inner_grey) == (b.edge.outer_grey > b.edge.inner_grey)) continue;
        if (std::abs(a.edge.place_m - b.edge.place_m) > kMastSizeM[1] ||
            std::abs(a.edge.lateral_m - b.edge.lateral_m) > kMastSizeM[1])
          continue;
        const auto size = size_between(a.edge, b.edge);
        if (!size || size->largest_m() >= smallest_m) continue;
        if (size->largest_m() >= kMastSizeM[0] && is_far_side_of_post(a.edge)) continue;
        smallest_m = size->largest_m();
        best = *size;
        best_inner = &a;
        best_outer = &b;
      }
    }
    if (best_inner == nullptr) return;
    best_inner->used = best_outer->used = true;
    if (smallest_m >= kMastSizeM[0]) tell_mast(best_inner->edge, mast_place(best_inner->edge, &best_outer->edge, best));
  }
}

// A mast of which only one edge could be followed: the other one shows beside it in the near looks.
void UprightObjects::find_stripes(double way_m) {
  for (Edge& e : edges_) {
    if (e.used || e.way_m > way_m - kWaitM || e.edge.stripe_count == 0 || belongs_to_mast(e.edge)) continue;
    const auto size = size_outward(e.edge);
    if (!size || size->rms_m > kStripeRmsM || !between(size->largest_m(), kMastSizeM)) continue;
    if (is_far_side_of_post(e.edge)) continue;
    e.used = true;
    tell_mast(e.edge, mast_place(e.edge, nullptr, *size));
  }
}

void UprightObjects::tell_mast(const SettledEdge& inner, const MastPlace& at) {
  if (!between(std::abs(at.lateral_m), kMastLateralM) || inner.sigma_m > kWorstSigmaM) return;
  if (in_tunnel(at.place_m)) return;  // lamps, niches, panels
  for (const UprightObject& mast : masts_) {
    if (std::abs(mast.place_m - at.place_m) < kSameMastM && mast.lateral_m * at.lateral_m > 0) return;
  }
  masts_.push_back(
      {LandmarkType::mast, at.place_m, at.lateral_m, std::hypot(at.sigma_m, kObjectSigmaM), inner.pictures});
  masts_.back().seen_at(inner.last_look());
  objects_.push_back(masts_.back());
}

bool UprightObjects::belongs_to_mast(const SettledEdge& edge) const {
  return std::any_of(masts_.begin(), masts_.end(), [&edge](const UprightObject& mast) {
    return std::abs(mast.place_m - edge.place_m) < kSameMastM && std::abs(mast.lateral_m - edge.lateral_m) < kSameMastM;
  });
}

// In a curve that was followed wrongly both sides are off by the same, one forwards and one backwards. Of two that are
// equally near both together tell place and width better than each its own; a wall beside another track leaves the
// picture long before the near one, which is seen best alone.
UprightObject UprightObjects::between_sides(const SettledEdge& left, const SettledEdge& right) {
  const double left_share = near_share(left.lateral_m, right.lateral_m);
  const double right_share = 1 - left_share;
  UprightObject object{LandmarkType::bridge, left_share * left.place_m + right_share * right.place_m, 0,
                       std::hypot(left_share * left.sigma_m, right_share * right.sigma_m, kObjectSigmaM),
                       std::min(left.pictures, right.pictures)};
  object.wall_m = {right.lateral_m, left.lateral_m};
  const LookAt nearest = left.last_look().way_m > right.last_look().way_m ? left.last_look() : right.last_look();
  object.seen_at(nearest);
  const auto opening = opening_between(left, right);
  if (!opening || std::abs(opening->place_m - object.place_m) > kOpeningOffM) return object;
  const double wider_m = opening->width_m - (left.lateral_m - right.lateral_m);
  object.wall_m = {right.lateral_m - left_share * wider_m, left.lateral_m + right_share * wider_m};
  if (opening->last.way_m + kNearerAloneM < nearest.way_m) return object;
  object.sigma_m = std::hypot(opening->sigma_m, kObjectSigmaM, 0.5 * (opening->place_m - object.place_m));
  object.place_m = opening->place_m;
  object.seen_ns = opening->last.stamp_ns;
  object.seen_ahead_m = opening->last_ahead_m;
  return object;
}

void UprightObjects::pair_sides(const GroundShade& shade, double way_m) {
  const auto dark = [](const SettledEdge& edge) {
    return edge.inner_grey < kDarkShare * edge.outer_grey && edge.wall_grey < kWallShare * edge.outer_grey;
  };
  const auto deep = [](const SettledEdge& edge) { return edge.deep_grey < kDeepShare * edge.outer_grey; };
  for (Edge& left : edges_) {
    for (Edge& right : edges_) {
      if (left.used || right.used || left.edge.lateral_m < 1 || right.edge.lateral_m > -1) continue;
      if (std::max(left.way_m, right.way_m) > way_m - kWaitM) continue;
      if (std::abs(left.edge.place_m - right.edge.place_m) > kSidesM) continue;
      if (!dark(left.edge) || !dark(right.edge)) continue;
      if (belongs_to_mast(left.edge) || belongs_to_mast(right.edge)) continue;
      const double width_m = left.edge.lateral_m - right.edge.lateral_m;
      // Behind a bridge there is daylight again; in the dark it looks like a portal.
      if (!daylight() && (deep(left.edge) || deep(right.edge))) continue;
      const bool portal = between(width_m, kTunnelWidthM) && deep(left.edge) && deep(right.edge);
      if (!portal && !between(width_m, kBridgeWidthM)) continue;
      UprightObject object = between_sides(left.edge, right.edge);
      if (portal) {
        object.type = LandmarkType::portal_in;
        object.outer_grey = std::min(left.edge.outer_grey, right.edge.outer_grey);
        move_to_mouth(object, left.edge, right.edge);
      }
      if (!roofed(shade, object.place_m)) continue;
      left.used = right.used = true;
      hold(object);
    }
  }
}

// Noise barriers, or lorries on both sides of a crossing, end as walls of a bridge do, but leave the ground its light.
// Where that was taken for so of a mouth, the panels behind it are not told in its stead.
bool UprightObjects::roofed(const GroundShade& shade, double place_m) {
  const auto share = shade.share(place_m);
  if (!share) return false;
  const double behind_m = place_m - open_above_m_;
  const bool panel = behind_m > -kSidesM && behind_m < kNextPanelM;
  if (*share < kRoofedShare && !panel) return true;
  open_above_m_ = std::max(open_above_m_, place_m);
  return false;
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
    portal.seen_at(e.edge.last_look());
  }
}

// A portal's outer corners look like a bridge and come first.
void UprightObjects::hold(const UprightObject& object) {
  for (UprightObject& held : held_) {
    if (std::abs(held.place_m - object.place_m) > kForgetM) continue;
    if (held.type == LandmarkType::bridge && object.type != LandmarkType::bridge) held = object;
    return;
  }
  held_.push_back(object);
}

bool UprightObjects::in_tunnel(double way_m) const {
  return way_m > tunnel_.since_m && way_m - tunnel_.since_m < kLongestTunnelM;
}

void UprightObjects::release(double way_m) {
  for (const UprightObject& held : held_) {
    if (held.place_m > way_m + kHoldM || in_tunnel(held.place_m + kForgetM)) continue;
    if (held.type == LandmarkType::portal_in) {
      tunnel_ = {held.place_m, held.outer_grey, held.wall_m, {kWallSigmaM, kWallSigmaM}};
      exits_ = {};
    }
    if (held.type == LandmarkType::bridge) {
      if (held.place_m - last_bridge_m_ < kSameBridgeM) continue;  // its far side
      last_bridge_m_ = held.place_m;
    }
    objects_.push_back(held);
  }
  std::erase_if(held_, [way_m](const UprightObject& held) { return held.place_m <= way_m + kHoldM; });
}

}  // namespace railfix::track_detector
