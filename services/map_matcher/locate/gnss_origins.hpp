// Where on the map a train may be that GNSS hears: from there on the search of the map follows it, and from nowhere
// else.
#pragma once

#include <vector>

#include "map_matcher/locate/gnss_search.hpp"
#include "map_matcher/locate/network_index.hpp"
#include "map_matcher/locate/place_filter.hpp"

namespace railfix::map_matcher {

/// Of every track within reach that runs as the train does, and some way further; moved_m: since it was heard there.
/// ahead: the train runs as its front looks.
[[nodiscard]] std::vector<PlaceFilter::Origin> origins_near(const NetworkIndex& index, const GnssReach& reach,
                                                            double moved_m, bool ahead);

}  // namespace railfix::map_matcher
