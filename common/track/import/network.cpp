#include "track/import/network.hpp"

#include <algorithm>
#include <cmath>
#include <set>

#include "core/units.hpp"

namespace railfix::track {
namespace {

constexpr double kTouchM = 0.05;
constexpr double kTouchRad = 0.02;
constexpr double kSharpestTurnRad = core::kPi / 3.0;
constexpr double kNeighbourM = 50.0;

struct End {
  size_t track = 0;
  bool is_end = false;
  PlanPose pose;
};

std::vector<End> ends_of(const std::vector<ImportedTrack>& tracks) {
  std::vector<End> ends;
  for (size_t i = 0; i < tracks.size(); ++i) {
    ends.push_back({i, false, tracks[i].alignment.at(0).pose});
    ends.push_back({i, true, tracks[i].alignment.at(tracks[i].alignment.length_m()).pose});
  }
  return ends;
}

/// Where the end touches the track, as an offset of the track.
std::optional<double> touch(const End& end, const Alignment& track) {
  const Alignment::Nearest nearest = track.nearest(end.pose.easting_m, end.pose.northing_m);
  if (std::abs(nearest.lateral_m) > kTouchM) return std::nullopt;
  const double turn = 2.0 * (track.at(nearest.offset_m).pose.heading_rad - end.pose.heading_rad);
  if (std::abs(core::wrap_pi(turn)) > 2.0 * kTouchRad) return std::nullopt;  // either direction
  return nearest.offset_m;
}

std::string told(const End& end, const std::vector<ImportedTrack>& tracks) {
  double nearest_m = kNeighbourM;
  std::string neighbour;
  for (size_t i = 0; i < tracks.size(); ++i) {
    if (i == end.track) continue;
    const double distance = std::abs(tracks[i].alignment.nearest(end.pose.easting_m, end.pose.northing_m).lateral_m);
    if (distance >= nearest_m) continue;
    nearest_m = distance;
    neighbour = tracks[i].name;
  }
  std::string sentence =
      std::string("the ") + (end.is_end ? "end" : "start") + " of " + tracks[end.track].name + " is not connected";
  if (!neighbour.empty()) {
    sentence += "; the nearest track, " + neighbour + ", is " + std::to_string(nearest_m) + " m away";
  }
  return sentence;
}

size_t node_at(const PlanPose& pose, Draft& draft) {
  const auto found = std::find_if(draft.nodes.begin(), draft.nodes.end(), [&](const DraftNode& node) {
    return std::hypot(node.easting_m - pose.easting_m, node.northing_m - pose.northing_m) < 2.0 * kTouchM;
  });
  if (found != draft.nodes.end()) return static_cast<size_t>(found - draft.nodes.begin());
  draft.nodes.push_back({"", pose.easting_m, pose.northing_m});
  return draft.nodes.size() - 1;
}

void add_piece(const ImportedTrack& track, double from_m, double to_m, size_t number, Draft& draft) {
  DraftEdge edge;
  edge.track.name = number == 1 ? track.name : track.name + "#" + std::to_string(number);
  edge.track.line = track.line;
  edge.track.alignment = slice(track.alignment, from_m, to_m);
  for (TrackMark mark : track.marks) {
    if (mark.offset_m < from_m || mark.offset_m >= to_m) continue;
    mark.offset_m -= from_m;
    edge.track.marks.push_back(mark);
  }
  const PlanPose begin = track.alignment.at(from_m).pose;
  const PlanPose end = edge.track.alignment.at(edge.track.alignment.length_m()).pose;
  edge.leaving_from_rad = begin.heading_rad;
  edge.leaving_to_rad = end.heading_rad + core::kPi;
  edge.from_node = node_at(begin, draft);
  edge.to_node = node_at(end, draft);
  draft.edges.push_back(std::move(edge));
}

/// One edge's end at a node.
struct Meeting {
  size_t edge = 0;
  double leaving_rad = 0;
};

struct Pair {
  size_t a = 0;
  size_t b = 0;
  double turn_rad = 0;
  bool same_line = false;
};

std::vector<Pair> possible_pairs(const Draft& draft, const std::vector<Meeting>& meetings) {
  std::vector<Pair> pairs;
  for (size_t a = 0; a < meetings.size(); ++a) {
    for (size_t b = a + 1; b < meetings.size(); ++b) {
      const double turn = std::abs(core::wrap_pi(meetings[b].leaving_rad - meetings[a].leaving_rad - core::kPi));
      if (turn > kSharpestTurnRad) continue;
      const std::string& line = draft.edges[meetings[a].edge].track.line;
      pairs.push_back({a, b, turn, !line.empty() && line == draft.edges[meetings[b].edge].track.line});
    }
  }
  // A line's own pieces first where the turn does not tell them apart, else the smallest turn.
  std::sort(pairs.begin(), pairs.end(), [](const Pair& x, const Pair& y) {
    const auto cost = [](const Pair& pair) { return pair.turn_rad - (pair.same_line ? kTouchRad : 0.0); };
    return cost(x) < cost(y);
  });
  return pairs;
}

void connect(const Draft& draft, size_t node, const std::vector<Meeting>& meetings, uint32_t first_edge,
             uint32_t node_id, Map& map) {
  std::set<size_t> has_straight_way;
  std::vector<Connection> diverging;
  for (const Pair& pair : possible_pairs(draft, meetings)) {
    Connection connection{node_id, first_edge + static_cast<uint32_t>(meetings[pair.a].edge),
                          first_edge + static_cast<uint32_t>(meetings[pair.b].edge), false};
    if (!has_straight_way.contains(pair.a) && !has_straight_way.contains(pair.b)) {
      has_straight_way.insert({pair.a, pair.b});
      map.connections.push_back(connection);
    } else if (!draft.nodes[node].is_crossing) {
      connection.diverging = true;
      diverging.push_back(connection);
    }
  }
  map.connections.insert(map.connections.end(), diverging.begin(), diverging.end());
}

NodeKind kind_of(const DraftNode& node, size_t meetings) {
  if (node.is_crossing) return NodeKind::crossing;
  if (node.is_switch || meetings > 2) return NodeKind::railway_switch;
  return meetings == 2 ? NodeKind::joint : NodeKind::end;
}

}  // namespace

Alignment slice(const Alignment& alignment, double from_m, double to_m) {
  std::vector<Element> elements;
  std::vector<PlanPose> starts;
  for (size_t i = 0; i < alignment.elements().size(); ++i) {
    const Element& element = alignment.elements()[i];
    const double begin = alignment.element_offsets()[i];
    const double from = std::max(from_m - begin, 0.0);
    const double to = std::min(to_m - begin, element.length_m);
    if (to - from <= 1e-9) continue;
    const double rate = (element.curvature_end_per_m - element.curvature_start_per_m) / element.length_m;
    elements.push_back(
        {to - from, element.curvature_start_per_m + rate * from, element.curvature_start_per_m + rate * to});
    starts.push_back(advance(alignment.starts()[i], element, from));
  }
  std::vector<GradePoint> profile = alignment.profile();
  for (GradePoint& point : profile) point.offset_m -= from_m;
  std::vector<CantPoint> cant = alignment.cant();
  for (CantPoint& point : cant) point.offset_m -= from_m;
  return {std::move(elements), std::move(starts), std::move(profile), std::move(cant)};
}

Draft cut_tracks(std::vector<ImportedTrack> tracks, std::vector<std::string>& problems) {
  std::vector<std::vector<double>> cuts(tracks.size());
  for (const End& end : ends_of(tracks)) {
    bool touches = false;
    for (size_t other = 0; other < tracks.size(); ++other) {
      if (other == end.track) continue;
      const std::optional<double> offset = touch(end, tracks[other].alignment);
      if (!offset) continue;
      touches = true;
      if (*offset > kTouchM && *offset < tracks[other].alignment.length_m() - kTouchM) cuts[other].push_back(*offset);
    }
    if (!touches) problems.push_back(told(end, tracks));
  }
  Draft draft;
  for (size_t i = 0; i < tracks.size(); ++i) {
    std::sort(cuts[i].begin(), cuts[i].end());
    cuts[i].push_back(tracks[i].alignment.length_m());
    double from = 0;
    size_t number = 0;
    for (const double to : cuts[i]) {
      if (to - from < 2.0 * kTouchM) continue;
      add_piece(tracks[i], from, to, ++number, draft);
      from = to;
    }
  }
  return draft;
}

void append(const Draft& draft, Map& map) {
  const auto first_node = static_cast<uint32_t>(map.nodes.size() + 1);
  const auto first_edge = static_cast<uint32_t>(map.edges.size() + 1);
  std::vector<std::vector<Meeting>> meetings(draft.nodes.size());
  for (size_t i = 0; i < draft.edges.size(); ++i) {
    const DraftEdge& in = draft.edges[i];
    meetings[in.from_node].push_back({i, in.leaving_from_rad});
    meetings[in.to_node].push_back({i, in.leaving_to_rad});
    const auto id = static_cast<uint32_t>(map.edges.size() + 1);
    map.edges.push_back({.id = id,
                         .name = in.track.name,
                         .from_node = first_node + static_cast<uint32_t>(in.from_node),
                         .to_node = first_node + static_cast<uint32_t>(in.to_node),
                         .line = in.track.line,
                         .alignment = in.track.alignment});
    for (const TrackMark& mark : in.track.marks) {
      const auto number = static_cast<uint32_t>(map.landmarks.size() + 1);
      map.landmarks.push_back({number, mark.kind, id, mark.offset_m, mark.lateral_m, mark.sigma_m, mark.name});
    }
  }
  for (size_t i = 0; i < draft.nodes.size(); ++i) {
    const DraftNode& node = draft.nodes[i];
    const uint32_t id = first_node + static_cast<uint32_t>(i);
    map.nodes.push_back({id, kind_of(node, meetings[i].size()), node.name, node.easting_m, node.northing_m});
    connect(draft, i, meetings[i], first_edge, id, map);
  }
}

}  // namespace railfix::track
