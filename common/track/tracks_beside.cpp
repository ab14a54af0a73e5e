#include "track/tracks_beside.hpp"

#include <algorithm>
#include <cmath>

#include "track/aside.hpp"

namespace railfix::track {
namespace {

constexpr double kBesideM = 15.0;  // GNSS is not believed to tell tracks that are nearer
constexpr double kEndM = 0.1;
constexpr double kOwnTrackM = 1.0;    // aside: nearer than that an edge that ends is the same track's next one
constexpr double kAlongAlikeM = 3.0;  // beside what the map may have wrong about both
constexpr double kAlongSigmas = 3.0;
constexpr double kFarthestAlongM = 100.0;  // no map is worse than that
constexpr double kAcrossAlikeM = 3.0;      // twice what a sighting may be off
constexpr double kFarthestAsideM = 9.0;    // that a mast is sighted

/// As a train meets it that runs on some way.
struct Met {
  const Landmark* landmark = nullptr;
  LandmarkKind kind = LandmarkKind::unknown;
  double off_m = 0;  // along the way, from where it is looked for
  double lateral_m = 0;
};

/// Calls `take` with all that stands up to `reach_m` further on, over every way that leads on. A train that runs the
/// way `backwards` meets it.
template <class Take>
void meet_ahead(const Map& map, const Junctions& junctions, const Run& run, double from_m, bool backwards,
                const Take& take, double reach_m = kFarthestAlongM, double run_m = 0) {
  for (const auto* landmark : map.landmarks_on(run.edge->id)) {
    const double off_m = run.into_m(landmark->offset_m) - from_m;
    const bool forward = run.forward != backwards;
    if (off_m < 0 || off_m > reach_m) continue;
    take(Met{landmark, seen_along(landmark->kind, forward), run_m + off_m,
             forward ? landmark->lateral_m : -landmark->lateral_m});
  }
  const double rest_m = run.length_m() - from_m;
  if (rest_m >= reach_m) return;
  for (const Run& next : junctions.after(run))
    meet_ahead(map, junctions, next, 0, backwards, take, reach_m - rest_m, run_m + rest_m);
}

/// Somebody who looks for the landmark takes what he meets for it.
bool is_alike(const Met& met, double seen_aside_m, const Landmark& landmark) {
  const double sigma_m = std::hypot(landmark.sigma_m, met.landmark->sigma_m);
  if (met.kind != landmark.kind || met.off_m > kAlongAlikeM + kAlongSigmas * sigma_m) return false;
  if (landmark.lateral_m == 0 || met.lateral_m == 0) return true;  // not known
  if (std::abs(seen_aside_m) > kFarthestAsideM) return false;
  if (is_aside_measured(landmark) && is_aside_measured(*met.landmark))
    return std::abs(seen_aside_m - landmark.lateral_m) < kAcrossAlikeM;
  return (seen_aside_m > 0) == (landmark.lateral_m > 0);
}

}  // namespace

std::vector<NearTrack> TracksBeside::abeam(double easting_m, double northing_m) const {
  auto near = finder_.near(easting_m, northing_m, kBesideM);
  std::erase_if(near, [&](const NearTrack& one) {
    const auto* edge = map_->edge(one.edge);
    if (edge->is_drawn) return true;
    if (one.offset_m > kEndM && one.offset_m < edge->alignment.length_m() - kEndM) return false;
    // Where two edges of a track meet just abeam neither lies further on.
    const auto end = edge->alignment.at(one.offset_m).pose;
    const double along_m = (easting_m - end.easting_m) * std::sin(end.heading_rad) +
                           (northing_m - end.northing_m) * std::cos(end.heading_rad);
    return std::abs(along_m) > kEndM || std::abs(one.lateral_m) < kOwnTrackM;
  });
  return near;
}

std::vector<TrackBeside> TracksBeside::beside(const EdgePosition& place) const {
  const auto* edge = map_->edge(place.edge);
  if (edge->is_drawn) return {};
  const auto pose = edge->alignment.at(place.offset_m).pose;
  std::vector<TrackBeside> tracks;
  for (const NearTrack& near : abeam(pose.easting_m, pose.northing_m)) {
    if (near.edge == place.edge) continue;
    const auto there = map_->edge(near.edge)->alignment.at(near.offset_m).pose;
    tracks.push_back({near, there.heading_rad - pose.heading_rad});
  }
  return tracks;
}

bool TracksBeside::many_at(double easting_m, double northing_m) const {
  return abeam(easting_m, northing_m).size() > 1;
}

bool TracksBeside::has_alike(const Landmark& landmark) const {
  return std::ranges::any_of(beside({landmark.edge, landmark.offset_m}),
                             [&](const TrackBeside& track) { return has_alike(landmark, track); });
}

// What stands beside its own track is seen from the other one as well, nearer or further aside.
bool TracksBeside::has_alike(const Landmark& landmark, const TrackBeside& track) const {
  const bool along = std::cos(track.turned_rad) >= 0;
  bool alike = false;
  const auto look = [&](const Run& run, double at_m, double moved_aside_m) {
    const auto take = [&](const Met& met) { alike = alike || is_alike(met, met.lateral_m + moved_aside_m, landmark); };
    meet_ahead(*map_, junctions_, run, run.into_m(at_m), false, take);
    meet_ahead(*map_, junctions_, run.reversed(), run.reversed().into_m(at_m), true, take);
  };
  look({map_->edge(track.edge), along}, track.offset_m, 0);
  if (stands_aside(landmark.kind))
    look({map_->edge(landmark.edge), true}, landmark.offset_m, along ? track.lateral_m : -track.lateral_m);
  return alike;
}

}  // namespace railfix::track
