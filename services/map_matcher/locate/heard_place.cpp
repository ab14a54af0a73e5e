#include "map_matcher/locate/heard_place.hpp"

#include <algorithm>
#include <cmath>

#include "core/units.hpp"

namespace railfix::map_matcher {
namespace {

constexpr double kLastsM = 2000.0;  // as in a tunnel
constexpr double kRockingM = 5.0;   // shorter than a car: it stands on the same leg of every switch as before
constexpr double kPlacesEveryM = 40.0;
constexpr double kRoughM = 250.0;     // a candidate's place is known to that, ...
constexpr double kRoughShare = 1.05;  // ... and the way from it
constexpr double kWideSigmas = 4.0;   // so far along the way from what fits best the train may be
constexpr double kAbeamM = 0.1;
constexpr int kNewtonSteps = 8;

}  // namespace

void HeardPlace::hear(const GnssReach& reach, double since_m) {
  heard_ = {reach, since_m, std::abs(since_m)};
}

void HeardPlace::move(double way_m) {
  if (!heard_) return;
  heard_->since_m += way_m;
  heard_->run_m += std::abs(way_m);
  if (heard_->run_m > kLastsM || heard_->run_m - std::abs(heard_->since_m) > 2 * kRockingM) heard_.reset();
}

double HeardPlace::places(const NetworkIndex& index) const {
  const auto& reach = heard_->reach;
  const auto tracks = index.near(reach.easting_m, reach.northing_m, reach.across_m).size();
  return static_cast<double>(tracks) * (1 + 2 * reach.along_m / kPlacesEveryM);
}

bool HeardPlace::may_hold(const Candidate& candidate, size_t bins) const {
  const auto& [reach, since_m, run_m] = *heard_;
  const auto pose = candidate.run.pose_at(candidate.into_m);
  const double way_m = run_m + kBinM * static_cast<double>(bins);
  const double apart_m = std::hypot(reach.easting_m - pose.easting_m, reach.northing_m - pose.northing_m);
  return apart_m < reach.along_m + std::abs(reach.antenna_ahead_m) + kRoughShare * way_m + kRoughM;
}

// The way may be a bend and its place rough: the antenna's foot on it is looked for.
std::optional<WayFit> HeardPlace::held(WayFit fit, const MeasuredRun& run) const {
  const auto& [reach, since_m, run_m] = *heard_;
  const double sign = run.ahead() ? 1 : -1;
  const double open_m = fit.scale * run.open_m();
  const double then_m = fit.end_m + open_m + sign * (reach.antenna_ahead_m - fit.scale * since_m);
  double antenna_m = then_m;
  double ahead_m = INFINITY;
  double across_m = 0;
  double turned_rad = 0;
  for (int k = 0; k < kNewtonSteps && std::abs(ahead_m) > kAbeamM; ++k) {
    if (k > 0) antenna_m += ahead_m;
    const auto at = place_on(fit.runs, antenna_m);
    const auto pose = at.run.pose_at(at.into_m);
    const double east_m = reach.easting_m - pose.easting_m;
    const double north_m = reach.northing_m - pose.northing_m;
    ahead_m = east_m * std::sin(pose.heading_rad) + north_m * std::cos(pose.heading_rad);
    across_m = east_m * std::cos(pose.heading_rad) - north_m * std::sin(pose.heading_rad);
    turned_rad = core::wrap_pi(pose.heading_rad + (run.ahead() ? 0 : core::kPi) - reach.heading_rad);
  }
  const double along_m = antenna_m - then_m;
  const bool abeam = std::abs(ahead_m) < reach.along_m && std::abs(along_m) < reach.along_m + kWideSigmas * fit.sigma_m;
  if (!abeam || std::abs(across_m) > reach.across_m || std::abs(turned_rad) > GnssReach::kCrossesRad)
    return std::nullopt;
  if (reach.sigma_m < fit.sigma_m) {
    fit.end_m += along_m;
    fit.sigma_m = reach.sigma_m;
  }
  return fit;
}

}  // namespace railfix::map_matcher
