// Two tracks of OpenStreetMap that share a node and both go on: slip or crossing?
#pragma once

#include <string>
#include <vector>

#include "track/import/network.hpp"
#include "track/import/osm/osm_chains.hpp"

namespace railfix::track {

/// Makes a crossing of a node whose tracks lie on different layers. Tells these, the slips that nothing says to be any,
/// and single slips, of which nothing says which two ways they have. REQUIRES: one edge of the draft for each chain, in
/// their order.
void judge_crossings(const OsmData& data, const std::vector<OsmChain>& chains, Draft& draft,
                     std::vector<std::string>& problems);

}  // namespace railfix::track
