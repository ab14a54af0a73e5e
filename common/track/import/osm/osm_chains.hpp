// OpenStreetMap ways cut and joined to chains that run from switch to switch (or end, or crossing).
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "track/import/osm/osm_data.hpp"
#include "track/import/osm/osm_stray_nodes.hpp"

namespace railfix::track {

/// Segments from one break to the next.
struct OsmChain {
  std::vector<int64_t> nodes;
  std::vector<size_t> ways;     // of each segment
  std::vector<bool> along_way;  // the segment runs as its way is drawn
  std::vector<Eigen::Vector2d> points;
  std::vector<Eigen::Vector2d> shape;  // the points as the track is to run through them
  std::optional<double> heading_at_start;
  std::optional<double> heading_at_end;
};

struct OsmChains {
  std::vector<OsmChain> chains;
  OsmPlaces places;               // of the nodes of tracks
  std::vector<std::string> cuts;  // problems that cut the network
  std::vector<std::string> problems;
};

/// In the order of the file: the same file always gives the same chains. `smooth_m` as in build_osm_network().
OsmChains chains_of(const OsmData& data, const Projection& projection, double smooth_m);

/// "node 5 of way/7 at latitude 48.200000, longitude 15.600000"; "the point" where the source gives it no number.
std::string called(int64_t node, const GeoPoint& at, int64_t way);

/// What to do where no track has two of its nodes in the data; else empty.
std::string lack_of_nodes(const OsmData& data);

}  // namespace railfix::track
