#include "map_matcher/locate/gnss_search.hpp"

#include <algorithm>
#include <cmath>

#include "core/units.hpp"
#include "track/path.hpp"

namespace railfix::map_matcher {
namespace {

constexpr size_t kLeastSeen = 10;
constexpr double kWayM = 100.0;  // over which GNSS and odometer must agree, ...
constexpr double kOffM = 10.0;   // ... to this and
constexpr double kOffShare = 0.05;
constexpr double kRocksM = 2.0;    // a train that stands or begins to move
constexpr double kAlongRad = 0.5;  // of a track that the train may be on: the way may be a bend
constexpr double kAbeamM = 1.0;    // what is further ahead or behind lies beyond the track's end

double heading_on(const track::Map& map, const track::EdgePosition& place) {
  const auto pose = map.edge(place.edge)->alignment.at(place.offset_m).pose;
  return pose.heading_rad + (place.direction == track::Direction::reverse ? core::kPi : 0);
}

}  // namespace

void GnssSearch::add(const GnssPosition& position, double odometer_m) {
  const double run_m = seen_.empty() ? 0 : seen_.back().run_m + std::abs(odometer_m - seen_.back().odometer_m);
  seen_.push_back({position, odometer_m, run_m});
  while (seen_.size() > kLeastSeen && std::abs(odometer_m - seen_[1].odometer_m) >= kWayM) seen_.pop_front();
}

bool GnssSearch::agrees() const {
  const auto& from = seen_.front();
  return std::ranges::all_of(seen_, [&](const Seen& to) {
    const double way_m = std::abs(to.odometer_m - from.odometer_m);
    const double apart_m =
        std::hypot(to.position.easting_m - from.position.easting_m, to.position.northing_m - from.position.northing_m);
    return std::abs(apart_m - way_m) < kOffM + kOffShare * way_m;
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

std::vector<track::EdgePosition> GnssSearch::tracks_at(const GnssPosition& position, double heading_rad) const {
  std::vector<track::EdgePosition> tracks;
  for (const auto& near : index_->near(position.easting_m, position.northing_m, kReachM)) {
    const auto pose = index_->map().edge(near.edge)->alignment.at(near.offset_m).pose;
    const double ahead_m = (position.easting_m - pose.easting_m) * std::sin(pose.heading_rad) +
                           (position.northing_m - pose.northing_m) * std::cos(pose.heading_rad);
    if (std::abs(ahead_m) > kAbeamM) continue;
    for (const auto direction : {track::Direction::forward, track::Direction::reverse}) {
      const track::EdgePosition place{near.edge, near.offset_m, direction};
      if (std::abs(core::wrap_pi(heading_on(index_->map(), place) - heading_rad)) < kAlongRad) tracks.push_back(place);
    }
  }
  return tracks;
}

// The same track, and no switch between that leads elsewhere.
bool GnssSearch::comes_from(const track::EdgePosition& place, const Seen& before) const {
  const double way_m = seen_.back().odometer_m - before.odometer_m;
  const double reach_m = std::abs(way_m) + kReachM;
  const auto path = track::Path::follow(index_->shared_map(), place, reach_m, reach_m);
  if (!path.ok()) return false;
  const auto pose = path.value().at(-way_m).pose;
  return std::hypot(pose.easting_m - before.position.easting_m, pose.northing_m - before.position.northing_m) < kReachM;
}

std::optional<track::EdgePosition> GnssSearch::place() const {
  const auto heading = heading_rad();
  if (!heading) return std::nullopt;
  const auto here = tracks_at(seen_.back().position, *heading);
  if (here.size() != 1 || tracks_at(seen_.front().position, *heading).size() != 1) return std::nullopt;
  return comes_from(here.front(), seen_.front()) ? std::optional(here.front()) : std::nullopt;
}

std::optional<size_t> GnssSearch::tracks() const {
  const auto heading = heading_rad();
  return heading ? std::optional(tracks_at(seen_.back().position, *heading).size()) : std::nullopt;
}

}  // namespace railfix::map_matcher
