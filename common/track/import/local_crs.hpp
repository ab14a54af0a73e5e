// A plane for data that come in degrees only.
#pragma once

#include <string>

#include "track/projection.hpp"

namespace railfix::track {

/// True to scale at its middle: a metre on the map is a metre on the ground to 1e-5 within 25 km.
std::string local_crs(const GeoPoint& middle);

}  // namespace railfix::track
