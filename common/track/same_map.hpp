// Two services of a train each read a map file of their own: after an update of one of them its edges may be numbered
// otherwise, and a place of the one is somewhere else for the other.
#pragma once

#include <cmath>

#include "core/units.hpp"
#include "track/ways.hpp"

namespace railfix::track {

/// A place that somebody else says, where on his map the cab looks along the track so: does it lie there on this map,
/// too, in that direction? Coordinates that are not told (0, 0 or no numbers) contradict nothing, nor does a heading
/// that is none.
inline bool lies_there(const Map& map, const EdgePosition& place, const PlanPose& told) {
  constexpr double kSamePlaceM = 1.0;
  constexpr double kSameHeadingRad = 0.2;
  const Edge* edge = map.edge(place.edge);
  if (edge == nullptr) return false;
  const bool is_told =
      std::isfinite(told.easting_m) && std::isfinite(told.northing_m) && (told.easting_m != 0 || told.northing_m != 0);
  if (!is_told || !std::isfinite(place.offset_m)) return true;
  const PlanPose here = cab_pose(map, place);
  if (std::hypot(here.easting_m - told.easting_m, here.northing_m - told.northing_m) >= kSamePlaceM) return false;
  if (place.direction == Direction::unknown || !std::isfinite(told.heading_rad)) return true;
  return std::abs(core::wrap_pi(here.heading_rad - told.heading_rad)) < kSameHeadingRad;
}

}  // namespace railfix::track
