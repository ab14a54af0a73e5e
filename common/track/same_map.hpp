// Two services of a train each read a map file of their own: after an update of one of them its edges may be numbered
// otherwise, and a place of the one is somewhere else for the other.
#pragma once

#include <cmath>

#include "track/map.hpp"

namespace railfix::track {

/// A place that somebody else says, on his map at these coordinates: does it lie there on this map, too? Coordinates
/// that are not told (0, 0 or no numbers) contradict nothing.
inline bool lies_there(const Map& map, const EdgePosition& place, double easting_m, double northing_m) {
  constexpr double kSamePlaceM = 1.0;
  const Edge* edge = map.edge(place.edge);
  if (edge == nullptr) return false;
  const bool told = std::isfinite(easting_m) && std::isfinite(northing_m) && (easting_m != 0 || northing_m != 0);
  if (!told || !std::isfinite(place.offset_m)) return true;
  const PlanPose pose = edge->alignment.at(place.offset_m).pose;
  return std::hypot(pose.easting_m - easting_m, pose.northing_m - northing_m) < kSamePlaceM;
}

}  // namespace railfix::track
