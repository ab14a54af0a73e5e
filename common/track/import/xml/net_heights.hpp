// Heights along the tracks of a net, out of their slopes.
#pragma once

#include <utility>
#include <vector>

#include "track/import/xml/rail_net.hpp"

namespace railfix::track {

/// The profile of every track, on its plan; empty where no track of the net has slopes. `nodes`: where each track
/// begins and ends. Heights run on from track to track, 0 where they begin: no source gives them above the sea, which
/// `problems` says. A track without slopes climbs evenly between the heights that others give its ends, which
/// `problems` says too, and is level where only one end has one.
std::vector<std::vector<GradePoint>> net_profiles(RailNet& net, const std::vector<std::pair<size_t, size_t>>& nodes);

}  // namespace railfix::track
