// How long the map's metres are: a projection lengthens and shortens.
#pragma once

#include <optional>
#include <string>

#include "track/map.hpp"

namespace railfix::track {

/// Map metres per kilometre that are too many (too few: negative), against the ellipsoid.
struct ScaleRange {
  double least_m_per_km = 0;
  double most_m_per_km = 0;
};

/// Along all edges, in every direction; nothing where the coordinate system is not known.
std::optional<ScaleRange> scale_over(const Map& map);

/// What is wrong with it and what to do; empty where it is within 0.5 m per km.
std::string scale_problem(const Map& map);

}  // namespace railfix::track
