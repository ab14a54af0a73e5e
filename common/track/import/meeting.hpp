// What is wrong where edges meet, and where they should but do not.
#pragma once

#include <string>
#include <vector>

#include "core/units.hpp"
#include "track/map.hpp"

namespace railfix::track {

/// Straight blades turn by 1 in 40 (1.4 degrees) at the most: no track has more, on a switch or elsewhere.
constexpr double kKinkRad = core::rad_from_deg(2.0);

/// A loose end so near to a track should meet it; a gap in line is longer.
constexpr double kNearMissM = 1.5;

/// Loose ends that should meet a track and do not, each with the nearest one: so near to it, or turned towards it as
/// the branch of a switch is. A buffer stop beside the next track is neither.
std::vector<std::string> near_misses(const Map& map);

/// How many ends of edges from this index on touch the edges before it.
size_t ends_on_edges_before(const Map& map, size_t first);

/// Edges that lie on others for 100 m or more, as no branch does.
std::vector<std::string> lying_on_others(const Map& map);

/// Loose ends that face each other over a gap in line: the track between them is missing.
std::vector<std::string> facing_ends(const Map& map);

/// Ways over nodes with a kink that no track has: the worst by name, the others counted.
std::vector<std::string> kinks_at_nodes(const Map& map);

}  // namespace railfix::track
