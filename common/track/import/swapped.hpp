// A place whose latitude stands where its longitude belongs.
#pragma once

#include <cmath>

#include "track/projection.hpp"

namespace railfix::track {

constexpr const char* kMayBeSwapped = "latitude and longitude may be swapped";

inline GeoPoint swapped(const GeoPoint& place) {
  return {.lat_deg = place.lon_deg, .lon_deg = place.lat_deg};
}

inline bool is_on_earth(const GeoPoint& place) {
  return std::abs(place.lat_deg) <= 90.0 && std::abs(place.lon_deg) <= 180.0;
}

/// No place on the Earth, but one the other way round.
inline bool may_be_swapped(const GeoPoint& place) {
  return !is_on_earth(place) && is_on_earth(swapped(place));
}

}  // namespace railfix::track
