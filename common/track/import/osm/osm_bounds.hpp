// Where a file says that its data lie.
#pragma once

#include <string>

#include "track/import/osm/osm_data.hpp"

namespace railfix::track {

struct OsmBounds {
  GeoPoint south_west;
  GeoPoint north_east;
};

/// Adds to the problems of the data whether their tracks lie elsewhere, and what may be wrong then. Tracks that only
/// reach beyond the bounds do not contradict them: extracts hold whole ways.
void tell_contradiction(const OsmBounds& declared, OsmData& data);

}  // namespace railfix::track
