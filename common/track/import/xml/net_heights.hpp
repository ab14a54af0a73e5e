// Heights along the tracks of a net, out of their slopes.
#pragma once

#include <map>
#include <utility>
#include <vector>

#include "track/import/xml/rail_net.hpp"

namespace railfix::track {

/// The profile of every track, on its plan; empty where no track of the net has slopes and no node a height. `nodes`:
/// where each track begins and ends; `heights`: what the source says of nodes, above the sea. Heights run on from track
/// to track, from these, and from 0 where none leads there: where there are none at all `problems` says so. A track
/// without slopes climbs evenly between the heights that others give its ends, which `problems` says too, and is level
/// where only one end has one: a guess, and marked as such.
std::vector<std::vector<GradePoint>> net_profiles(RailNet& net, const std::vector<std::pair<size_t, size_t>>& nodes,
                                                  const std::map<size_t, double>& heights = {});

}  // namespace railfix::track
