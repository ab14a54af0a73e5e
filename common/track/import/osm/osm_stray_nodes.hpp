// Nodes that lie off the track that their neighbours make: typing errors, slips of a hand.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <unordered_map>
#include <vector>

namespace railfix::track {

using OsmPlaces = std::unordered_map<int64_t, Eigen::Vector2d>;
using OsmNeighbours = std::unordered_map<int64_t, std::vector<int64_t>>;  // along the tracks

struct StrayNode {
  int64_t node = 0;
  double off_m = 0;  // from the straight line between its neighbours
};

/// The farthest first. Only what cannot be track: it turns there and back within three nodes, and runs on without the
/// node as if it had never been there. Ends of tracks are not judged: nobody says where those lead.
std::vector<StrayNode> stray_nodes(const OsmPlaces& places, const OsmNeighbours& neighbours);

}  // namespace railfix::track
