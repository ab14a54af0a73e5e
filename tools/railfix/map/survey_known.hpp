// Which of the map's landmarks the sightings of a survey are of.
#pragma once

#include <cmath>
#include <vector>

#include "map/survey.hpp"
#include "track/aside.hpp"

namespace railfix::tool {

inline bool has_side(track::LandmarkKind kind) {
  return track::stands_aside(kind);
}

/// Same kind, same track, as far aside: the masts of the track beside are seen as well.
inline bool alike(const SurveySighting& a, track::LandmarkKind kind, uint32_t edge, double lateral_m,
                  bool measured = true) {
  return a.kind == kind && a.edge == edge && (!has_side(kind) || track::fits_aside(a.lateral_m, lateral_m, measured));
}

inline constexpr double kOnePassM = 50;  // of a run: no thing is passed twice within it, ...

/// Passed by one run one behind the other: two things, however near.
inline bool told_apart(const SurveySighting& a, const SurveySighting& b) {
  constexpr double kTwiceToldM = 0.5;  // ... but it may be told twice
  return a.run == b.run && a.stretch == b.stretch && std::abs(a.way_m - b.way_m) < kOnePassM &&
         std::abs(a.unmoved_m() - b.unmoved_m()) > kTwiceToldM;
}

/// Of every sighting, seen at `places` along its edge; nullptr = the map does not have it within the gate. Landmarks
/// that a run tells apart are never taken for one: where the map has a pair elsewhere than all see it, each is still
/// its own.
std::vector<const track::Landmark*> known_marks(const track::Map& map, const std::vector<SurveySighting>& all,
                                                const std::vector<double>& places, double gate_m);

}  // namespace railfix::tool
