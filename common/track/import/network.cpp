#include "track/import/network.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <set>

#include "core/units.hpp"
#include "track/import/told.hpp"

namespace railfix::track {
namespace {

constexpr double kTouchM = 0.05;
constexpr double kTouchRad = 0.02;
constexpr double kNeighbourM = 50.0;
constexpr double kLeavingM = 5.0;
// By how much more the straight way may turn than another one. Drawn by hand, tracks are off by a degree or two; a
// sharp turnout bends by more than four over the same metres.
constexpr double kSameLineRad = kTouchRad;
constexpr double kSameWayRad = core::rad_from_deg(2.0);
constexpr double kRunningLineRad = core::rad_from_deg(2.0);

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

/// The track lies within it.
Eigen::AlignedBox2d box_of(const Alignment& track) {
  Eigen::AlignedBox2d box;
  for (size_t i = 0; i < track.elements().size(); ++i) {
    const Element& element = track.elements()[i];
    const double off_m = bulge_m(element);
    for (const PlanPose& end : {track.starts()[i], advance(track.starts()[i], element, element.length_m)}) {
      const Eigen::Vector2d at(end.easting_m, end.northing_m);
      box.extend(at + Eigen::Vector2d(off_m, off_m));
      box.extend(at - Eigen::Vector2d(off_m, off_m));
    }
  }
  return box;
}

/// A track and where to look for it: most ends lie near few of many tracks.
struct BoxedTrack {
  const ImportedTrack* track = nullptr;
  Eigen::AlignedBox2d box;
  [[nodiscard]] bool is_near(const End& end, double within_m) const {
    return box.exteriorDistance(Eigen::Vector2d(end.pose.easting_m, end.pose.northing_m)) < within_m;
  }
};

std::vector<BoxedTrack> boxed(const std::vector<ImportedTrack>& tracks) {
  std::vector<BoxedTrack> out;
  out.reserve(tracks.size());
  for (const ImportedTrack& track : tracks) out.push_back({&track, box_of(track.alignment)});
  return out;
}

/// Where the end touches the track, as an offset of the track.
std::optional<double> touch(const End& end, const Alignment& track) {
  const Alignment::Nearest nearest = track.nearest(end.pose.easting_m, end.pose.northing_m);
  if (std::abs(nearest.lateral_m) > kTouchM) return std::nullopt;
  const double turn = 2.0 * (track.at(nearest.offset_m).pose.heading_rad - end.pose.heading_rad);
  if (std::abs(core::wrap_pi(turn)) > 2.0 * kTouchRad) return std::nullopt;  // either direction
  return nearest.offset_m;
}

/// A ring's ends are one place.
bool meets_itself(const Alignment& track) {
  const PlanPose begin = track.at(0).pose;
  const PlanPose end = track.at(track.length_m()).pose;
  return std::hypot(end.easting_m - begin.easting_m, end.northing_m - begin.northing_m) < kTouchM &&
         std::abs(core::wrap_pi(end.heading_rad - begin.heading_rad)) < kTouchRad;
}

std::string told(const End& end, const std::vector<BoxedTrack>& tracks) {
  double nearest_m = kNeighbourM;
  std::string neighbour;
  for (size_t i = 0; i < tracks.size(); ++i) {
    if (i == end.track || !tracks[i].is_near(end, nearest_m)) continue;
    const Alignment& track = tracks[i].track->alignment;
    const double distance = std::abs(track.nearest(end.pose.easting_m, end.pose.northing_m).lateral_m);
    if (distance >= nearest_m) continue;
    nearest_m = distance;
    neighbour = tracks[i].track->name;
  }
  std::string sentence = std::string("the ") + (end.is_end ? "end" : "start") + " of " + tracks[end.track].track->name +
                         " is not connected";
  if (!neighbour.empty()) {
    sentence += "; the nearest track, " + neighbour + ", is " + told_m(nearest_m) + " away";
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

/// Where a train heads that has left the node by a few metres: tells a branch from the track it is tangent to.
double leaving_rad(const Alignment& piece, bool at_end) {
  const double into = std::min(kLeavingM, 0.5 * piece.length_m());
  const double heading = piece.at(at_end ? piece.length_m() - into : into).pose.heading_rad;
  return at_end ? heading + core::kPi : heading;
}

/// Marks and groups of the track that lie on the piece; a group goes with its reference, its balises stay within.
void take_marks(const ImportedTrack& track, double from_m, double to_m, bool is_last, ImportedTrack& piece) {
  const auto is_on_piece = [&](double offset_m) {
    return offset_m >= from_m && (offset_m < to_m || (is_last && offset_m <= to_m));
  };
  for (TrackMark mark : track.marks) {
    if (!is_on_piece(mark.offset_m)) continue;
    mark.offset_m -= from_m;
    piece.marks.push_back(std::move(mark));
  }
  for (TrackGroup group : track.groups) {
    if (!is_on_piece(group.offset_m)) continue;
    group.offset_m -= from_m;
    for (TrackMark& balise : group.balises) balise.offset_m = std::clamp(balise.offset_m - from_m, 0.0, to_m - from_m);
    piece.groups.push_back(std::move(group));
  }
  for (SpeedLimit limit : track.speed_limits) {
    limit.from_m = std::max(limit.from_m - from_m, 0.0);
    limit.to_m = std::min(limit.to_m, to_m) - from_m;
    if (limit.to_m > limit.from_m) piece.speed_limits.push_back(limit);
  }
}

struct Pair {
  size_t a = 0;
  size_t b = 0;
  double cost_rad = 0;
  bool diverging = false;
};

/// What the source says of the two ends; nothing where no train runs from one to the other.
std::optional<ToldWay> told_way(const DraftNode& node, const EdgeEnd& a, const EdgeEnd& b) {
  const std::pair from(a.edge, a.at_end);
  const std::pair to(b.edge, b.at_end);
  for (const ToldWay& way : node.ways) {
    if ((way.a == from && way.b == to) || (way.a == to && way.b == from)) return way;
  }
  return std::nullopt;
}

double turn_between_rad(double leaving_a_rad, double leaving_b_rad) {
  return std::abs(core::wrap_pi(leaving_b_rad - leaving_a_rad - core::kPi));
}

/// The least that the source leaves room for: its first metres may be drawn askew.
double least_turn_rad(const EdgeEnd& a, const EdgeEnd& b) {
  const double first_rad = turn_between_rad(a.leaving_rad, b.leaving_rad);
  if (!a.onward || !b.onward) return first_rad;
  return std::min(first_rad, turn_between_rad(a.onward->heading_rad, b.onward->heading_rad));
}

double bonus_for_line_rad(const std::string& a, const std::string& b) {
  return !a.empty() && a == b ? kSameLineRad : 0.0;
}

/// The turn from one end to the other, less for what belongs together. Trains are taken for going straight on until
/// something tells, and most of them follow the line and not the crossover that leaves it.
double cost_rad(const Draft& draft, const EdgeEnd& a, const EdgeEnd& b) {
  if (!a.onward || !b.onward) {
    return turn_between_rad(a.leaving_rad, b.leaving_rad) -
           bonus_for_line_rad(draft.edges[a.edge].track.line, draft.edges[b.edge].track.line);
  }
  const bool same_way = a.onward->way == b.onward->way;
  const bool running = a.onward->is_running_line && b.onward->is_running_line;
  return turn_between_rad(a.onward->heading_rad, b.onward->heading_rad) - (running ? kRunningLineRad : 0.0) -
         (same_way ? kSameWayRad : bonus_for_line_rad(a.onward->line, b.onward->line));
}

std::vector<Pair> possible_pairs(const Draft& draft, const DraftNode& node, const std::vector<EdgeEnd>& ends) {
  std::vector<Pair> pairs;
  for (size_t a = 0; a < ends.size(); ++a) {
    for (size_t b = a + 1; b < ends.size(); ++b) {
      const auto way = told_way(node, ends[a], ends[b]);
      const bool too_sharp = turn_between_rad(ends[a].leaving_rad, ends[b].leaving_rad) > kSharpestTurnRad;
      if (node.ways_are_told ? !way : too_sharp) continue;
      pairs.push_back({a, b, cost_rad(draft, ends[a], ends[b]), way && way->diverging});
    }
  }
  std::sort(pairs.begin(), pairs.end(), [](const Pair& x, const Pair& y) { return x.cost_rad < y.cost_rad; });
  return pairs;
}

bool only_cross(const DraftNode& node, const std::vector<EdgeEnd>& ends, const std::vector<WayOver>& straight,
                const std::vector<WayOver>& diverging) {
  if (node.is_switch || node.ways_are_told || ends.size() != 4 || straight.size() != 2) return false;
  return std::ranges::all_of(
      diverging, [&](const WayOver& way) { return least_turn_rad(ends[way.a], ends[way.b]) > kSharpestSlipRad; });
}

NodeKind kind_of(const DraftNode& node, size_t ends, const std::vector<WayOver>& ways) {
  // Where each of four ends leads straight on to one other, and nowhere else, two tracks only cross.
  const bool crosses = ends == 4 && ways.size() == 2 && !ways[0].diverging && !ways[1].diverging;
  if (node.is_crossing || (crosses && !node.is_switch)) return NodeKind::crossing;
  if (node.is_switch || ends > 2) return NodeKind::railway_switch;
  return ends == 2 ? NodeKind::joint : NodeKind::end;
}

}  // namespace

std::vector<std::vector<EdgeEnd>> ends_at_nodes(const Draft& draft) {
  std::vector<std::vector<EdgeEnd>> ends(draft.nodes.size());
  for (size_t i = 0; i < draft.edges.size(); ++i) {
    const DraftEdge& edge = draft.edges[i];
    ends[edge.from_node].push_back({i, false, edge.leaving_from_rad, edge.onward_from});
    ends[edge.to_node].push_back({i, true, edge.leaving_to_rad, edge.onward_to});
  }
  return ends;
}

std::vector<WayOver> ways_over(const Draft& draft, size_t node, const std::vector<EdgeEnd>& ends) {
  std::set<size_t> has_straight_way;
  std::vector<WayOver> straight;
  std::vector<WayOver> diverging;
  for (const Pair& pair : possible_pairs(draft, draft.nodes[node], ends)) {
    if (!pair.diverging && !has_straight_way.contains(pair.a) && !has_straight_way.contains(pair.b)) {
      has_straight_way.insert({pair.a, pair.b});
      straight.push_back({pair.a, pair.b, false});
    } else if (!draft.nodes[node].is_crossing) {
      diverging.push_back({pair.a, pair.b, true});
    }
  }
  if (only_cross(draft.nodes[node], ends, straight, diverging)) return straight;
  straight.insert(straight.end(), diverging.begin(), diverging.end());
  return straight;
}

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
  return {std::move(elements), std::move(starts), points_between(alignment.profile(), from_m, to_m),
          points_between(alignment.cant(), from_m, to_m)};
}

void add_pieces(const ImportedTrack& track, const std::vector<TrackCut>& cuts, Draft& draft) {
  for (size_t i = 0; i + 1 < cuts.size(); ++i) {
    const double from = cuts[i].offset_m;
    const double to = cuts[i + 1].offset_m;
    DraftEdge edge;
    edge.track.name = i == 0 ? track.name : track.name + "#" + std::to_string(i + 1);
    edge.track.line = track.line;
    edge.track.is_drawn = track.is_drawn;
    edge.track.alignment = slice(track.alignment, from, to);
    take_marks(track, from, to, i + 2 == cuts.size(), edge.track);
    edge.leaving_from_rad = leaving_rad(edge.track.alignment, false);
    edge.leaving_to_rad = leaving_rad(edge.track.alignment, true);
    edge.from_node = cuts[i].node;
    edge.to_node = cuts[i + 1].node;
    draft.edges.push_back(std::move(edge));
  }
}

Draft cut_tracks(std::vector<ImportedTrack> tracks, std::vector<std::string>& problems) {
  std::vector<std::vector<double>> cuts(tracks.size());
  const std::vector<BoxedTrack> near = boxed(tracks);
  for (const End& end : ends_of(tracks)) {
    bool touches = meets_itself(tracks[end.track].alignment);
    for (size_t other = 0; other < tracks.size(); ++other) {
      if (other == end.track || !near[other].is_near(end, 2.0 * kTouchM)) continue;
      const std::optional<double> offset = touch(end, tracks[other].alignment);
      if (!offset) continue;
      touches = true;
      if (*offset > kTouchM && *offset < tracks[other].alignment.length_m() - kTouchM) cuts[other].push_back(*offset);
    }
    if (!touches) problems.push_back(told(end, near));
  }
  Draft draft;
  for (size_t i = 0; i < tracks.size(); ++i) {
    cuts[i].push_back(0.0);
    cuts[i].push_back(tracks[i].alignment.length_m());
    std::sort(cuts[i].begin(), cuts[i].end());
    std::vector<TrackCut> nodes;
    for (const double offset : cuts[i]) {
      if (!nodes.empty() && offset - nodes.back().offset_m < 2.0 * kTouchM) continue;
      nodes.push_back({offset, node_at(tracks[i].alignment.at(offset).pose, draft)});
    }
    nodes.back().offset_m = tracks[i].alignment.length_m();
    if (nodes.size() > 1) add_pieces(tracks[i], nodes, draft);
  }
  return draft;
}

void append(const Draft& draft, Map& map) {
  const auto add_landmark = [&](uint32_t edge, const TrackMark& mark) {
    const auto number = static_cast<uint32_t>(map.landmarks.size() + 1);
    map.landmarks.push_back({number, mark.kind, edge, mark.offset_m, mark.lateral_m, mark.sigma_m, mark.name});
    return number;
  };
  const auto first_node = static_cast<uint32_t>(map.nodes.size() + 1);
  const auto first_edge = static_cast<uint32_t>(map.edges.size() + 1);
  for (const DraftEdge& in : draft.edges) {
    const auto id = static_cast<uint32_t>(map.edges.size() + 1);
    map.edges.push_back({.id = id,
                         .name = in.track.name,
                         .from_node = first_node + static_cast<uint32_t>(in.from_node),
                         .to_node = first_node + static_cast<uint32_t>(in.to_node),
                         .line = in.track.line,
                         .alignment = in.track.alignment,
                         .speed_limits = in.track.speed_limits,
                         .is_drawn = in.track.is_drawn});
    for (const TrackMark& mark : in.track.marks) add_landmark(id, mark);
    for (const TrackGroup& in_group : in.track.groups) {
      BaliseGroup group{.nid_c = in_group.nid_c,
                        .nid_bg = in_group.nid_bg,
                        .edge = id,
                        .offset_m = in_group.offset_m,
                        .nominal_is_forward = in_group.nominal_is_forward,
                        .is_virtual = false,
                        .q_locacc_m = in_group.q_locacc_m,
                        .balises = {}};
      for (const TrackMark& balise : in_group.balises) group.balises.push_back(add_landmark(id, balise));
      map.balise_groups.push_back(std::move(group));
    }
  }
  const std::vector<std::vector<EdgeEnd>> ends = ends_at_nodes(draft);
  for (size_t i = 0; i < draft.nodes.size(); ++i) {
    const DraftNode& node = draft.nodes[i];
    const uint32_t id = first_node + static_cast<uint32_t>(i);
    const std::vector<WayOver> ways = ways_over(draft, i, ends[i]);
    map.nodes.push_back({id, kind_of(node, ends[i].size(), ways), node.name, node.easting_m, node.northing_m});
    for (const WayOver& way : ways) {
      map.connections.push_back({id, first_edge + static_cast<uint32_t>(ends[i][way.a].edge),
                                 first_edge + static_cast<uint32_t>(ends[i][way.b].edge), way.diverging});
    }
  }
}

}  // namespace railfix::track
