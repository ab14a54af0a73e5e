#include "track/tracks_beside.hpp"

#include <algorithm>
#include <cmath>

namespace railfix::track {
namespace {

constexpr double kBesideM = 15.0;  // GNSS is not believed to tell tracks that are nearer
constexpr double kEndM = 0.1;
constexpr double kAlongAlikeM = 3.0;
constexpr double kAcrossAlikeM = 1.5;

/// Where either does not say its side (0) it may be the same one.
bool alike_across(double lateral_m, double other_m) {
  return lateral_m == 0 || other_m == 0 || std::abs(lateral_m - other_m) < kAcrossAlikeM;
}

}  // namespace

std::vector<NearTrack> TracksBeside::abeam(double easting_m, double northing_m) const {
  auto near = finder_.near(easting_m, northing_m, kBesideM);
  std::erase_if(near, [&](const NearTrack& one) {
    const auto* edge = map_->edge(one.edge);
    return edge->is_drawn || one.offset_m < kEndM || one.offset_m > edge->alignment.length_m() - kEndM;
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
  return std::ranges::any_of(beside({landmark.edge, landmark.offset_m}), [&](const TrackBeside& track) {
    const double side = std::cos(track.turned_rad) < 0 ? -1.0 : 1.0;
    return std::ranges::any_of(map_->landmarks_on(track.edge), [&](const Landmark* other) {
      return seen_along(other->kind, side > 0) == landmark.kind &&
             std::abs(other->offset_m - track.offset_m) < kAlongAlikeM &&
             alike_across(side * other->lateral_m, landmark.lateral_m);
    });
  });
}

}  // namespace railfix::track
