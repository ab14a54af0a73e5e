// Marks where OpenStreetMap edges meet or end: what one edge alone does not tell.
#pragma once

#include "track/import/osm/osm_marks.hpp"

namespace railfix::track {

/// Portals where a tunnel begins at a node, and what stands at the nodes themselves.
/// REQUIRES: the draft's edges were made from the chains, in their order.
void add_marks_at_nodes(const OsmData& data, const std::vector<OsmChain>& chains, Draft& draft, OsmPoints& points);

}  // namespace railfix::track
