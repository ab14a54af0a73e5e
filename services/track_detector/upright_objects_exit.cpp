// Where a tunnel ends: on the walls that were followed from the portal in.
#include <algorithm>
#include <cmath>

#include "track_detector/opening_fit.hpp"
#include "track_detector/upright_objects.hpp"

namespace railfix::track_detector {
namespace {

constexpr double kWallStray_m2 = 4e-5;  // of its lateral offset from one edge on it to the next
constexpr double kExitSigmaM = 0.2;     // the last piece of wall may be as bright as the land in the glare
constexpr double kEndSigmaM = 0.08;     // of an end that was measured on both walls
constexpr double kEndsAgreeM = 0.3;     // of the two walls; they did within 0.15 m
constexpr double kOneEndM = 0.12;       // between steps of both that are of one end
constexpr double kExitAgreesM = 0.15;   // both ways to measure it
constexpr double kSettlesM = 2.1;       // after it has left the picture, an edge is given
constexpr double kAlikeShare = 0.7;     // of the farther wall's lateral offset
constexpr double kOneEndSigmaM = 0.12;
constexpr double kExitOffM = 0.6;       // of an exit that one side's edge told
constexpr double kPanelM = 2.3;         // of the lining, at most
constexpr double kExitLateralM = 0.6;   // an exit's edge from the wall
constexpr double kExitWideShare = 0.7;  // of the widest bearing: near enough for the exit's place
constexpr double kDaylightShare = 0.8;  // of the brightness in front of the tunnel
constexpr double kOpenShare = 0.92;     // of the brightness far behind it
constexpr double kBurntOutGrey = 243;   // a picture does not show the last panel apart from brighter land
constexpr double kHiddenSigmaM = 0.6;   // ... and the wall may end where that panel does

// How far along the track the line of sight meets a wall beside it. In a curve of 500 m the wall bends by 6 cm over
// the 8 m to an edge that leaves the picture, which is 0.2 m along the track.
double way_to_wall_m(const EdgeMeasurement& look, double wall_m, double curvature_per_m) {
  const double across_m = wall_m - look.eye_lateral_m;
  const double straight_m = across_m / look.bearing;
  const double ahead_m = (across_m + 0.5 * curvature_per_m * straight_m * straight_m) / look.bearing;
  return ahead_m * (1 + curvature_per_m * wall_m);
}

}  // namespace

// Joints, niches and panels on a wall tell where it is now: the place of its end is as good as its lateral offset, and
// that of the portal in was measured with another error of the way, of a profile that may be another one.
void UprightObjects::follow_wall(const SettledEdge& edge) {
  const size_t side = edge.lateral_m > 0 ? 1 : 0;
  const double off_m = edge.lateral_m - tunnel_.wall_m[side];
  if (std::abs(off_m) > kSameWallM) return;
  const double variance = std::pow(tunnel_.wall_sigma_m[side], 2) + kWallStray_m2;
  const double gain = variance / (variance + std::pow(edge.lateral_sigma_m, 2));
  tunnel_.wall_m[side] += gain * off_m;
  tunnel_.wall_sigma_m[side] = std::sqrt((1 - gain) * variance);
}

// Where the walls end there is daylight. Before the camera has got used to it, the end is hidden in glare and only the
// panels before it show; so it is taken from the near looks alone, with the wall's lateral offset, which is known.
void UprightObjects::look_for_exit(const SettledEdge& edge) {
  const size_t side = edge.lateral_m > 0 ? 1 : 0;
  const double wall_m = tunnel_.wall_m[side];
  Exit& exit = exits_[side];
  if (std::abs(edge.lateral_m - wall_m) > kExitLateralM || edge.outer_grey > kDarkShare * edge.inner_grey) return;
  if (std::min(edge.inner_grey, edge.wall_grey) < kDaylightShare * tunnel_.daylight_grey) return;
  // A camera that is used to the dark shows panels as bright as land was before the tunnel, but the land behind
  // brighter.
  if (edge.inner_grey < kOpenShare * edge.deep_grey) return;
  const double widest = std::abs(edge.measured[edge.count - 1].bearing);
  double sum = 0, weights = 0;
  for (size_t i = 0; i < edge.count; ++i) {
    const EdgeMeasurement& m = edge.measured[i];
    if (std::abs(m.bearing) < kExitWideShare * widest) continue;
    const double weight = std::pow(m.bearing, 4);
    sum += weight * (m.way_m + way_to_wall_m(m, wall_m, edge.curvature_per_m));
    weights += weight;
  }
  if (sum < exit.place_m * weights) return;
  exit = {sum / weights, edge.sigma_m, edge.pictures, edge.inner_grey > kBurntOutGrey};
}

double UprightObjects::mean_of_walls_m(double right_m, double left_m) const {
  const double left_share = near_share(tunnel_.wall_m[1], tunnel_.wall_m[0]);
  return left_share * left_m + (1 - left_share) * right_m;
}

size_t UprightObjects::near_wall() const {
  return std::abs(tunnel_.wall_m[0]) < std::abs(tunnel_.wall_m[1]) ? 0 : 1;
}

bool UprightObjects::walls_alike() const {
  const size_t near = near_wall();
  return kAlikeShare * std::abs(tunnel_.wall_m[1 - near]) < std::abs(tunnel_.wall_m[near]);
}

// Where the brightness steps last. Each wall by itself: on the one the last piece may be as bright as the land while
// the other one shows its end. Walls that are equally near see alike: what one of them alone shows far from the
// followed edges stands behind the tunnel, and what the other one or those edges contradict is in doubt by half of
// that.
std::optional<UprightObjects::End> UprightObjects::end_of_walls(const EdgeTracker& tracker, double place_m) const {
  const size_t near = near_wall();
  std::array<WallSteps, 2> steps;
  for (size_t side = 0; side < 2; ++side) {
    steps[side] = tracker.steps(tunnel_.wall_m[side], place_m - kExitOffM, place_m + kPanelM);
  }
  const std::array<std::optional<double>, 2> ends_m{steps[0].last(), steps[1].last()};
  const bool both = ends_m[0] && ends_m[1];
  const double apart_m = both ? std::abs(*ends_m[0] - *ends_m[1]) : 0.0;
  if (both && apart_m < kEndsAgreeM) return end_of_both(steps);
  if (!walls_alike()) {
    const auto& end_m = ends_m[near] ? ends_m[near] : ends_m[1 - near];
    return end_m ? std::optional(End{*end_m, kOneEndSigmaM}) : std::nullopt;
  }
  const auto off_m = [&](size_t side) { return ends_m[side] ? std::abs(*ends_m[side] - place_m) : kSidesM; };
  const size_t side = off_m(0) < off_m(1) ? 0 : 1;
  if (off_m(side) >= kSidesM) return std::nullopt;
  return End{*ends_m[side], std::hypot(kOneEndSigmaM, 0.5 * std::max(apart_m, off_m(side)))};
}

// Of walls whose last steps are near one another, but not at one place, the one may show something that stands close
// behind the end: then the step before is where the other wall ends. What they are apart stays in doubt by half.
UprightObjects::End UprightObjects::end_of_both(const std::array<WallSteps, 2>& steps) const {
  const double last_m = mean_of_walls_m(steps[0].place_m[0], steps[1].place_m[0]);
  const double apart_m = std::abs(steps[0].place_m[0] - steps[1].place_m[0]);
  End end{last_m, apart_m < kOneEndM ? kEndSigmaM : std::hypot(kEndSigmaM, 0.5 * apart_m)};
  for (size_t i = 0; i < steps[0].count; ++i) {
    for (size_t k = 0; k < steps[1].count; ++k) {
      const double right_m = steps[0].place_m[i];
      const double left_m = steps[1].place_m[k];
      const bool at_one_end = std::max(std::abs(right_m - last_m), std::abs(left_m - last_m)) < kEndsAgreeM;
      if (!at_one_end || std::abs(right_m - left_m) > kOneEndM) continue;
      end.place_m = mean_of_walls_m(right_m, left_m);
      return end;
    }
  }
  return end;
}

// A last piece of wall may be brighter than the land behind it and darker than the haze above that: over all rows no
// step. How far behind the end half of the rows still show one.
double UprightObjects::beyond_m(const EdgeTracker& tracker, double place_m) const {
  double most_m = 0;
  for (const double wall_m : tunnel_.wall_m) {
    const auto last_m = tracker.steps(wall_m, place_m + kOneEndM, place_m + kPanelM, Rows::halves).last();
    if (last_m) most_m = std::max(most_m, *last_m - place_m);
  }
  return most_m;
}

// From so far ahead on an end and the panel that may follow it show no more, even on the wall that is nearer. What the
// train runs until then is known less well than the end.
double UprightObjects::exit_hold_m(const EdgeTracker& tracker) const {
  const double near_m = std::min(std::abs(tunnel_.wall_m[0]), std::abs(tunnel_.wall_m[1]));
  return std::max(kHoldM, tracker.leaves_ahead_m(near_m) - kPanelM - kSettlesM);
}

void UprightObjects::release_exit(const EdgeTracker& tracker, double way_m, double beside_grey) {
  const Exit& first = exits_[0].place_m > exits_[1].place_m ? exits_[0] : exits_[1];
  const Exit& other = &first == exits_.data() ? exits_[1] : exits_[0];
  if (first.pictures == 0 || first.place_m > way_m + exit_hold_m(tracker)) return;
  if (beside_grey < kOutShare * light_.usual_grey) {  // a lamp's light on the wall, and behind it the dark again
    exits_ = {};
    return;
  }
  const double apart_m = first.place_m - other.place_m;
  const bool both = apart_m < kSidesM;
  const bool hidden = first.burnt_out && (!both || other.burnt_out);
  double place_m = both ? mean_of_walls_m(exits_[0].place_m, exits_[1].place_m) : first.place_m;
  double sigma_m = std::hypot(kExitSigmaM, both ? 0.0 : kOneSideSigmaM);
  // The last piece of wall may be nearly as bright as the land behind it: its end is faint.
  if (const auto end = end_of_walls(tracker, place_m)) {
    // Where an edge was followed farther on, the last panel is about as bright as the land and shows no clear step.
    // What the wall beside another track shows tells less.
    const double followed_m = walls_alike() ? first.place_m : exits_[near_wall()].place_m;
    const double farther_m = followed_m - end->place_m;
    const bool agree = farther_m < kExitAgreesM;
    place_m = agree ? end->place_m : followed_m;
    sigma_m = agree ? end->sigma_m : std::hypot(kOneEndSigmaM, farther_m);
  }
  // The other wall ended before: this edge may be of what stands behind the tunnel.
  if (!both && apart_m < kPanelM) sigma_m = std::hypot(sigma_m, apart_m);
  sigma_m = std::hypot(sigma_m, 0.5 * beyond_m(tracker, place_m));
  if (hidden) sigma_m = std::hypot(sigma_m, kHiddenSigmaM);
  objects_.push_back({LandmarkType::portal_out, place_m, 0, sigma_m, first.pictures});
  if (const auto look = tracker.last_look_at(place_m, tunnel_.wall_m[near_wall()])) objects_.back().seen_at(*look);
  tunnel_ = {};
  exits_ = {};
}

}  // namespace railfix::track_detector
