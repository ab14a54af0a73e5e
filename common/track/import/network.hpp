// From pieces of track to a connected map: nodes, what a train can do at them, numbered landmarks.
#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "core/units.hpp"
#include "track/import/tracks.hpp"
#include "track/map.hpp"

namespace railfix::track {

/// No track turns more sharply at a node.
inline constexpr double kSharpestTurnRad = core::kPi / 3.0;

/// No slip leads a train more sharply from one track to the other. Those of 1 : 4.8, the shortest there are, turn by 12
/// degrees; the rest is for the drawing.
inline constexpr double kSharpestSlipRad = core::rad_from_deg(15.0);

/// The source says that trains run over a node from one edge's end to another's.
struct ToldWay {
  std::pair<size_t, bool> a;  // edge (index into Draft::edges), at its end
  std::pair<size_t, bool> b;
  bool diverging = false;
};

struct DraftNode {
  std::string name;
  double easting_m = 0;
  double northing_m = 0;
  bool is_switch = false;       // the source says so, whatever meets here
  bool is_crossing = false;     // tracks cross on the level, nobody can change track
  bool ways_are_told = false;   // `ways` are all there are
  std::vector<ToldWay> ways{};  // else they follow from the directions of the edges
};

/// How a track runs on from a node, where the source tells more than the direction of its first metres.
struct Onward {
  double heading_rad = 0;  // over some tens of metres
  int64_t way = 0;         // pieces of one way of the source
  std::string line{};      // there, while the edge's is that of most of it
  bool is_running_line = false;
};

struct DraftEdge {
  ImportedTrack track;
  size_t from_node = 0;  // index into Draft::nodes
  size_t to_node = 0;
  // Directions in which a train leaves the node on this edge, as surveyed (before a fit smoothed them).
  double leaving_from_rad = 0;
  double leaving_to_rad = 0;
  std::optional<Onward> onward_from{};
  std::optional<Onward> onward_to{};
};

struct Draft {
  std::vector<DraftNode> nodes;
  std::vector<DraftEdge> edges;
};

/// One edge's end at a node.
struct EdgeEnd {
  size_t edge = 0;  // index into Draft::edges
  bool at_end = false;
  double leaving_rad = 0;
  std::optional<Onward> onward{};
};

/// A train can run over a node from one of its ends to another; indices into the ends.
struct WayOver {
  size_t a = 0;
  size_t b = 0;
  bool diverging = false;
};

/// Of every node of the draft.
std::vector<std::vector<EdgeEnd>> ends_at_nodes(const Draft& draft);

/// Straight ways first. Two ends are connected where the source says so, or where it says nothing and the turn between
/// them is less than 60 degrees. The smallest turn is the straight way, unless it is little smaller than that of what
/// belongs together: pieces of a line, of a running line, of a way of the source. Two tracks that meet at more than 15
/// degrees and both go on only cross, unless the source calls it a switch.
std::vector<WayOver> ways_over(const Draft& draft, size_t node, const std::vector<EdgeEnd>& ends);

/// A node that lies on a track.
struct TrackCut {
  double offset_m = 0;
  size_t node = 0;  // index into Draft::nodes
};

/// Adds the pieces of a track between the nodes on it. REQUIRES: two cuts or more, by offset, at least 10 cm apart.
void add_pieces(const ImportedTrack& track, const std::vector<TrackCut>& cuts, Draft& draft);

/// Cuts tracks where the end of another touches them (within 5 cm and 20 mrad) and joins ends that meet. Every end that
/// meets nothing is told in `problems` with its nearest neighbour.
Draft cut_tracks(std::vector<ImportedTrack> tracks, std::vector<std::string>& problems);

/// Points of a list by offset that matter between two offsets: those within and two on either side.
template <class Point>
std::vector<Point> points_between(const std::vector<Point>& points, double from_m, double to_m) {
  const auto before = [](const Point& point, double offset_m) { return point.offset_m < offset_m; };
  const auto first = std::lower_bound(points.begin(), points.end(), from_m, before);
  const auto last = std::lower_bound(points.begin(), points.end(), to_m, before);
  std::vector<Point> out(first - std::min<ptrdiff_t>(2, first - points.begin()),
                         last + std::min<ptrdiff_t>(2, points.end() - last));
  for (Point& point : out) point.offset_m -= from_m;
  return out;
}

/// The part of an alignment between two offsets, with its profile and cant and what of them lies next to it.
Alignment slice(const Alignment& alignment, double from_m, double to_m);

/// Adds the draft to the map, its edges connected as ways_over() says.
void append(const Draft& draft, Map& map);

}  // namespace railfix::track
