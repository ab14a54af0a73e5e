// Where a file says that its data lie.
#pragma once

#include <string>

#include "track/import/osm/osm_data.hpp"

namespace railfix::track {

struct OsmBounds {
  GeoPoint south_west;
  GeoPoint north_east;
};

/// Whether the tracks lie elsewhere, and what may be wrong then; else empty. Tracks that only reach beyond the bounds
/// do not contradict them: extracts hold whole ways.
std::string contradiction(const OsmBounds& declared, const OsmData& data);

}  // namespace railfix::track
