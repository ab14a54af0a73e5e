// Whether a map lies where its coordinate system is made for: one whose axes are exchanged is a mirror image.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "track/map.hpp"
#include "track/projection.hpp"

namespace railfix::track {

/// Of tracks that lie around that place; empty but where the system is not made for it, and is for the place that it is
/// with latitude and longitude exchanged.
std::string told_swapped(const GeoPoint& middle, const Projection& projection, const std::string& crs);

/// Around which the tracks with coordinates lie; nothing where none have any or the map's system does not say.
std::optional<GeoPoint> middle_on_earth(const Map& map);

/// Where one of several inputs lies.
struct InputPlace {
  std::string name;
  GeoPoint middle;
};
/// A sentence for each that lies further from all those before it than one map reaches.
std::vector<std::string> told_apart(const std::vector<InputPlace>& inputs);

/// What is wrong with it and why that may be; empty where it lies within a degree of the system's area, or nobody
/// knows.
std::string whereabouts_problem(const Map& map);

}  // namespace railfix::track
