#include "map_matcher/locate/gnss_search.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <iterator>

#include "core/units.hpp"
#include "track/path.hpp"

namespace railfix::map_matcher {
namespace {

constexpr size_t kLeastSeen = 10;
constexpr size_t kMostSeen = 1000;  // of a train that is moved to and fro
constexpr double kWayM = 100.0;     // over which GNSS and odometer must agree, ...
constexpr double kOffM = 10.0;      // ... to this and
constexpr double kOffShare = 0.05;
constexpr double kRocksM = 2.0;      // a train that stands or begins to move
constexpr double kStandsM = 1.0;     // since the last position but one: it takes the last one's place
constexpr double kAlongRad = 0.5;    // of the track that is the train's: the way may be a bend
constexpr double kCrossesRad = 1.2;  // ... and one that turns more off is no track that the train may be on
constexpr double kAbeamM = 0.1;      // what is further ahead or behind lies beyond the edge's end
constexpr int kNewtonSteps = 6;
constexpr double kLookM = 10.0;  // from one place to the next on an edge that may come by again

/// Of a pose, or of another position.
template <typename Place>
double apart_m(const Place& place, const GnssPosition& position) {
  return std::hypot(position.easting_m - place.easting_m, position.northing_m - place.northing_m);
}

}  // namespace

bool GnssSearch::add(const GnssPosition& position, double odometer_m, double speed_mps) {
  const auto& p = parameters_;
  if (!(position.hdop <= p.most_hdop)) return false;
  const double reach_m = std::max(p.bound_m, p.interval_factor * p.sigma_m * position.hdop);
  Seen seen{position, odometer_m, 0, reach_m, p.lag_s * std::abs(speed_mps)};
  if (!seen_.empty()) {
    const auto moved_m = [&](const Seen& since) { return std::abs(odometer_m - since.odometer_m); };
    seen.run_m = seen_.back().run_m + moved_m(seen_.back());
    if (seen_.size() > 1 && moved_m(*std::next(seen_.rbegin())) < kStandsM) seen_.pop_back();
  }
  seen_.push_back(seen);
  const auto is_left = [&] { return std::abs(odometer_m - seen_[1].odometer_m) >= kWayM; };
  while (seen_.size() > kMostSeen || (seen_.size() > kLeastSeen && is_left())) seen_.pop_front();
  return true;
}

bool GnssSearch::agrees() const {
  const auto& from = seen_.front();
  return std::ranges::all_of(seen_, [&](const Seen& to) {
    const double way_m = std::abs(to.odometer_m - from.odometer_m);
    return std::abs(apart_m(from.position, to.position) - way_m) < kOffM + kOffShare * way_m;
  });
}

std::optional<double> GnssSearch::heading_rad() const {
  if (seen_.size() < kLeastSeen) return std::nullopt;
  const auto& from = seen_.front();
  const auto& to = seen_.back();
  const double way_m = to.odometer_m - from.odometer_m;
  const bool to_and_fro = to.run_m - from.run_m - std::abs(way_m) > kRocksM;
  if (std::abs(way_m) < kWayM || to_and_fro || !agrees()) return std::nullopt;
  const double east_m = to.position.easting_m - from.position.easting_m;
  const double north_m = to.position.northing_m - from.position.northing_m;
  return std::atan2(east_m, north_m) + (way_m < 0 ? core::kPi : 0);
}

// Where an edge ends and another goes on, only that one is abeam; where the track ends, the train may be just behind.
void GnssSearch::add_track(const track::NearTrack& near, const Seen& seen, double heading_rad,
                           std::vector<Near>& tracks) const {
  const auto* edge = index_->map().edge(near.edge);
  // The finder's foot is rough: a place that is not quite beside it must not seem to lie beyond the edge's end.
  double foot_m = near.offset_m;
  double ahead_m = INFINITY;
  for (int k = 0; k < kNewtonSteps && std::abs(ahead_m) > 0.1 * kAbeamM; ++k) {
    if (k > 0) foot_m = std::clamp(foot_m + ahead_m, 0.0, edge->alignment.length_m());
    const auto pose = edge->alignment.at(foot_m).pose;
    ahead_m = (seen.position.easting_m - pose.easting_m) * std::sin(pose.heading_rad) +
              (seen.position.northing_m - pose.northing_m) * std::cos(pose.heading_rad);
  }
  const bool abeam = std::abs(ahead_m) < kAbeamM;
  if (!abeam && !index_->ways().after({edge, ahead_m > 0}).empty()) return;
  for (const bool forward : {true, false}) {
    const track::Run run{edge, forward};
    const double into_m = run.into_m(foot_m);
    const double turned_rad = std::abs(core::wrap_pi(run.pose_at(into_m).heading_rad - heading_rad));
    if (turned_rad < kCrossesRad) tracks.push_back({run.at(into_m), abeam && turned_rad < kAlongRad});
  }
}

std::vector<GnssSearch::Near> GnssSearch::tracks_at(const Seen& seen, double heading_rad) const {
  std::vector<Near> tracks;
  for (const auto& near : index_->near(seen.position.easting_m, seen.position.northing_m, seen.reach_m))
    add_track(near, seen, heading_rad, tracks);
  const auto follows_another = [&](const Near& one) {
    const auto run = track::run_of(index_->map(), one.place);
    return std::ranges::any_of(tracks, [&](const Near& other) {
      const auto& after = index_->ways().after(track::run_of(index_->map(), other.place));
      return std::ranges::find(after, run) != after.end();
    });
  };
  std::vector<Near> single;  // at a joint both edges are abeam
  std::ranges::copy_if(tracks, std::back_inserter(single), std::not_fn(follows_another));
  return single;
}

// A balloon loop, or a line that winds up a valley: the same edge comes by once more.
bool GnssSearch::is_passed_again(const track::EdgePosition& place, const Seen& seen) const {
  const auto& alignment = index_->map().edge(place.edge)->alignment;
  for (double m = 0; m < alignment.length_m(); m += kLookM) {
    const bool elsewhere = std::abs(m - place.offset_m) > 3 * seen.reach_m;
    if (elsewhere && apart_m(alignment.at(m).pose, seen.position) < seen.reach_m + kLookM) return true;
  }
  return false;
}

std::optional<track::EdgePosition> GnssSearch::foot_behind(const track::EdgePosition& antenna) const {
  if (parameters_.antenna_ahead_m == 0) return antenna;
  const double reach_m = std::abs(parameters_.antenna_ahead_m) + 1;
  const auto path = track::Path::follow(index_->shared_map(), antenna, reach_m, reach_m);
  if (!path.ok()) return std::nullopt;
  const double foot_m = -parameters_.antenna_ahead_m;
  if (foot_m < path.value().begin_m() || foot_m > path.value().end_m()) return std::nullopt;
  return path.value().position_at(foot_m);
}

// It is the same track 100 m back, with no switch between that leads elsewhere.
std::optional<GnssPlace> GnssSearch::place() const {
  const auto heading = heading_rad();
  if (!heading) return std::nullopt;
  const Seen& now = seen_.back();
  const Seen& before = seen_.front();
  const auto here = tracks_at(now, *heading);
  if (here.size() != 1 || !here.front().fits || tracks_at(before, *heading).size() != 1) return std::nullopt;
  const auto& antenna = here.front().place;
  const double way_m = now.odometer_m - before.odometer_m;
  const auto path = track::Path::follow(index_->shared_map(), antenna, std::abs(way_m), std::abs(way_m));
  if (!path.ok() || apart_m(path.value().at(-way_m).pose, before.position) > before.reach_m) return std::nullopt;
  if (is_passed_again(antenna, now)) return std::nullopt;
  const auto foot = foot_behind(antenna);
  return foot ? std::optional(GnssPlace{*foot, (now.reach_m + now.late_m) / parameters_.interval_factor})
              : std::nullopt;
}

std::optional<size_t> GnssSearch::tracks() const {
  const auto heading = heading_rad();
  return heading ? std::optional(tracks_at(seen_.back(), *heading).size()) : std::nullopt;
}

}  // namespace railfix::map_matcher
