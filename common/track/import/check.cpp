#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <optional>
#include <set>

#include "core/units.hpp"
#include "track/import/finish.hpp"
#include "track/import/meeting.hpp"
#include "track/import/told.hpp"
#include "track/import/tracks.hpp"

namespace railfix::track {
namespace {

constexpr double kGapM = 0.05;
constexpr double kSharpestBendPerM = 1.0 / 80.0;
constexpr double kSteepest = 0.075;
constexpr double kStepM = 0.05;  // in height, from one profile point to the next
constexpr double kSamePlaceM = 0.5;
constexpr size_t kMostBends = 3;
// A drawing of straights and right lengths does not close to the last metre, nor where curves are not known.
constexpr double kDrawnGapM = 1.0;
constexpr double kDrawnGapPart = 0.01;

std::string identity(const BaliseGroup& group) {
  return std::to_string(group.nid_c) + "/" + std::to_string(group.nid_bg);
}

double distance(const PlanPose& pose, const Node& node) {
  return std::hypot(pose.easting_m - node.easting_m, pose.northing_m - node.northing_m);
}

class Check {
 public:
  explicit Check(const Map& map) : map_(map) {
    for (const Node& node : map.nodes) nodes_[node.id] = &node;
    for (const Edge& edge : map.edges) {
      ends_[edge.from_node].push_back(&edge);
      ends_[edge.to_node].push_back(&edge);
    }
    for (const Connection& way : map.connections) {
      connected_.insert({way.node, way.edge_a});
      connected_.insert({way.node, way.edge_b});
    }
  }

  std::vector<std::string> run() {
    for (const Edge& edge : map_.edges) {
      check_shape(edge);
      check_grades(edge);
      check_cant(edge);
      check_end(edge, edge.from_node, edge.alignment.at(0).pose);
      check_end(edge, edge.to_node, edge.alignment.at(edge.alignment.length_m()).pose);
    }
    check_cant_sides();
    for (const Node& node : map_.nodes) check_node(node);
    take(near_misses(map_), cuts_);
    take(facing_ends(map_), cuts_);
    take(lying_on_others(map_), cuts_);
    check_balises();
    check_parts();
    tell_sharpest();
    take(kinks_at_nodes(map_), shapes_);
    take(shapes_, cuts_);
    return std::move(cuts_);
  }

 private:
  /// The sharpest radius of an edge.
  struct Bend {
    double curvature_per_m = 0;
    const Edge* edge = nullptr;
    double offset_m = 0;
  };

  static void take(const std::vector<std::string>& found, std::vector<std::string>& into) {
    into.insert(into.end(), found.begin(), found.end());
  }

  /// Within one edge: elements that do not meet, kinks, radii that no train runs.
  void check_shape(const Edge& edge) {
    const Alignment& track = edge.alignment;
    Bend bend;
    for (size_t i = 0; i < track.elements().size(); ++i) {
      const Element& element = track.elements()[i];
      const std::string where = called(edge) + " at " + told_m(track.element_offsets()[i]);
      const double sharpest = std::max(std::abs(element.curvature_start_per_m), std::abs(element.curvature_end_per_m));
      if (sharpest > bend.curvature_per_m) bend = {sharpest, &edge, track.element_offsets()[i]};
      if (i == 0) continue;
      const PlanPose before = advance(track.starts()[i - 1], track.elements()[i - 1], track.elements()[i - 1].length_m);
      const PlanPose& start = track.starts()[i];
      const double gap = std::hypot(before.easting_m - start.easting_m, before.northing_m - start.northing_m);
      if (gap > kGapM) cuts_.push_back(where + " has a gap of " + told_m(gap));
      const double kink = std::abs(core::wrap_pi(before.heading_rad - start.heading_rad));
      if (kink > kKinkRad) shapes_.push_back(where + " has a kink of " + told_deg(kink));
    }
    if (bend.curvature_per_m > kSharpestBendPerM) bends_.push_back(bend);
  }

  /// The worst by name, the others counted: one yard has more than all the rest that is wrong.
  void tell_sharpest() {
    std::ranges::stable_sort(bends_, std::greater{}, &Bend::curvature_per_m);
    const auto radius = [](const Bend& bend) { return told_m(1.0 / bend.curvature_per_m); };
    const size_t named = std::min(kMostBends, bends_.size());
    for (size_t i = 0; i < named; ++i) {
      shapes_.push_back(called(*bends_[i].edge) + " at " + told_m(bends_[i].offset_m) + " has a radius of only " +
                        radius(bends_[i]));
    }
    if (bends_.size() > named) {
      shapes_.push_back(std::to_string(bends_.size() - named) + " more of " + std::to_string(map_.edges.size()) +
                        " edges have a radius of " + radius(bends_[named]) + " to " + radius(bends_.back()));
    }
  }

  /// A node as its source knows it: by its name and the tracks that share it. Its number is of this map alone.
  [[nodiscard]] std::string node_of(const Edge& edge, const Node& node) const {
    std::string others;
    for (const Edge* one : ends_.at(node.id)) {
      if (one != &edge) others += (others.empty() ? ", which it shares with " : " and ") + called(*one);
    }
    return numbered(node) + others;
  }
  static std::string numbered(const Node& node) {
    return "node " + std::to_string(node.id) + (node.name.empty() ? "" : " (" + node.name + ")");
  }

  void check_end(const Edge& edge, uint32_t node_id, const PlanPose& pose) {
    const auto node = nodes_.find(node_id);
    if (node == nodes_.end()) {
      cuts_.push_back(called(edge) + " ends at node " + std::to_string(node_id) + ", which does not exist");
      return;
    }
    const double gap = gap_m(edge, pose, *node->second);
    if (edge.is_drawn && gap > kDrawnGapM + kDrawnGapPart * edge.alignment.length_m()) {
      cuts_.push_back(called(edge) + " is drawn to end " + told_m(gap) + " from its " + node_of(edge, *node->second) +
                      ": do the lengths of the tracks there agree?");
    } else if (!edge.is_drawn && gap > kGapM) {
      cuts_.push_back(called(edge) + " ends " + told_m(gap) + " from its " + node_of(edge, *node->second));
    }
    if (ends_[node_id].size() > 1 && !connected_.contains({node_id, edge.id})) {
      cuts_.push_back(called(edge) + " is not connected to any other at its " + node_of(edge, *node->second));
    }
  }

  /// Between an end and its node. Where tracks of a drawing and others meet, only the others say where that is.
  double gap_m(const Edge& edge, const PlanPose& pose, const Node& node) {
    const std::vector<const Edge*>& meeting = ends_[node.id];
    const auto drawn = [](const Edge* one) { return one->is_drawn; };
    const auto surveyed = std::ranges::find_if_not(meeting, drawn);
    if (surveyed == meeting.end() || std::ranges::none_of(meeting, drawn)) return distance(pose, node);
    if (edge.is_drawn) return 0;
    const Alignment& track = (*surveyed)->alignment;
    const PlanPose at = track.at((*surveyed)->from_node == node.id ? 0.0 : track.length_m()).pose;
    return std::hypot(pose.easting_m - at.easting_m, pose.northing_m - at.northing_m);
  }

  void check_node(const Node& node) {
    const std::vector<const Edge*>& meeting = ends_[node.id];
    if (meeting.empty()) {
      cuts_.push_back(numbered(node) + " belongs to no edge");
    } else if (node.kind == NodeKind::railway_switch && meeting.size() < 3) {
      cuts_.push_back((node.name.empty() ? "a switch without a name" : "switch \"" + node.name + "\"") +
                      place_of(node) + " has only " + (meeting.size() == 1 ? "one track, " : "two tracks, ") +
                      end_at(*meeting.front(), node) +
                      (meeting.size() == 1 ? "" : " and " + end_at(*meeting.back(), node)));
    }
  }

  static std::string end_at(const Edge& edge, const Node& node) {
    const char* end = edge.from_node == edge.to_node ? "an end" : edge.to_node == node.id ? "the end" : "the start";
    return std::string(end) + " of " + called(edge);
  }

  /// Where to look for it in the source; a drawing is at no place.
  [[nodiscard]] std::string place_of(const Node& node) const {
    if (std::ranges::all_of(ends_.at(node.id), &Edge::is_drawn)) return "";
    const std::optional<GeoPoint> geo = map_.to_geo(node.easting_m, node.northing_m);
    if (!geo) return " at easting " + told_m(node.easting_m) + ", northing " + told_m(node.northing_m);
    return " at " + told_place(*geo);
  }

  /// Grades that no adhesion railway has. Points beyond the ends are of the edges next to it.
  void check_grades(const Edge& edge) {
    const std::vector<GradePoint>& profile = edge.alignment.profile();
    for (size_t i = 1; i < profile.size(); ++i) {
      if (profile[i].offset_m <= 0 || profile[i - 1].offset_m >= edge.alignment.length_m()) continue;
      const double run = profile[i].offset_m - profile[i - 1].offset_m;
      const double rise = profile[i].elevation_m - profile[i - 1].elevation_m;
      if (std::abs(rise) <= kSteepest * run || std::abs(rise) < kStepM) continue;
      shapes_.push_back(called(edge) + " at " + told_m(std::max(0.0, profile[i - 1].offset_m)) + " climbs " +
                        told_m(rise) + " over " + told_m(run));
      return;
    }
  }

  /// Millimetres taken for metres, for example.
  void check_cant(const Edge& edge) {
    for (const CantPoint& point : edge.alignment.cant()) {
      const double offset_m = std::clamp(point.offset_m, 0.0, edge.alignment.length_m());
      const double cant_m = edge.alignment.at(offset_m).cant_m;
      if (is_cant(cant_m)) continue;
      shapes_.push_back(called(edge) + " at " + told_m(offset_m) + " has a cant of " + told_m(cant_m) +
                        ", more than any track has");
      return;
    }
  }

  /// Of the whole map: the cant of curves that are canted to speak of lies on the outer rail, but for errors.
  void check_cant_sides() {
    constexpr double kEveryM = 10;
    constexpr double kCurvePerM = 1e-4;
    constexpr double kMillimetresM = 0.002;  // the largest of cants that were told in metres
    double outer_m = 0;
    double inner_m = 0;
    double largest_m = 0;
    for (const Edge& edge : map_.edges) {
      if (edge.alignment.cant().empty()) continue;
      for (double s_m = 0; s_m < edge.alignment.length_m(); s_m += kEveryM) {
        const TrackPoint at = edge.alignment.at(s_m);
        largest_m = std::max(largest_m, std::abs(at.cant_m));
        if (std::abs(at.cant_m) < kMillimetresM || std::abs(at.curvature_per_m) < kCurvePerM) continue;
        (at.cant_m * at.curvature_per_m > 0 ? outer_m : inner_m) += kEveryM;
      }
    }
    if (inner_m > outer_m) {
      shapes_.push_back("the inner rail is the higher one on " + told_m(inner_m, 0) + " of curves, the outer one on " +
                        told_m(outer_m, 0) + ": the signs of the cant, or the sides of the curves, are exchanged");
    }
    if (largest_m > 0 && largest_m < kMillimetresM) {
      shapes_.push_back("the largest cant is " + told_number(1e3 * largest_m, 2) +
                        " mm: the source has it in metres where it must be millimetres");
    }
  }

  /// Tracks that no train can reach from the largest part of the network, told once for each part, the longest first.
  void check_parts() {
    std::vector<size_t> part(map_.edges.size());
    for (size_t i = 0; i < part.size(); ++i) part[i] = i;
    const auto root = [&](size_t i) {
      while (part[i] != i) i = part[i] = part[part[i]];
      return i;
    };
    for (const Connection& way : map_.connections) {
      if (map_.edge(way.edge_a) != nullptr && map_.edge(way.edge_b) != nullptr)
        part[root(way.edge_a - 1)] = root(way.edge_b - 1);
    }
    struct Part {
      size_t edges = 0;
      double length_m = 0;
      const Edge* first = nullptr;
    };
    std::vector<Part> parts(part.size());  // by their roots
    for (size_t i = 0; i < part.size(); ++i) {
      Part& own = parts[root(i)];
      ++own.edges;
      own.length_m += map_.edges[i].alignment.length_m();
      if (own.first == nullptr) own.first = &map_.edges[i];
    }
    std::erase_if(parts, [](const Part& own) { return own.edges == 0; });
    std::ranges::stable_sort(parts, std::greater{}, &Part::length_m);
    for (size_t i = 1; i < parts.size(); ++i) {
      const Part& lost = parts[i];
      cuts_.push_back(called(*lost.first) + (lost.edges > 1 ? " and " + std::to_string(lost.edges - 1) + " more" : "") +
                      ", " + told_m(lost.length_m) + ", cannot be reached from the rest of the network");
    }
  }

  void check_balises() {
    std::vector<const Landmark*> balises;
    for (const Landmark& mark : map_.landmarks) {
      if (mark.kind == LandmarkKind::balise) balises.push_back(&mark);
    }
    // Of groups or alone: two at one place are one that is there twice.
    tell_same_places("balises", balises,
                     [](const Landmark& mark) { return mark.name.empty() ? "(no name)" : "\"" + mark.name + "\""; });
    std::vector<const BaliseGroup*> groups;
    for (const BaliseGroup& group : map_.balise_groups) groups.push_back(&group);
    tell_same_places("balise groups", groups, [](const BaliseGroup& group) { return identity(group); });
    std::map<uint32_t, const BaliseGroup*> seen;
    for (const BaliseGroup& group : map_.balise_groups) {
      const auto [first, is_new] = seen.emplace(group.nid_lrbg(), &group);
      if (is_new) continue;
      cuts_.push_back("balise group " + identity(group) + " is there twice, " +
                      place_on(first->second->edge, first->second->offset_m) + " and " +
                      place_on(group.edge, group.offset_m) + ": one of them has a wrong identity");
    }
  }

  [[nodiscard]] std::string place_on(uint32_t id, double offset_m) const {
    const Edge* edge = map_.edge(id);
    return (edge != nullptr ? called(*edge) : "edge " + std::to_string(id)) + " at " + told_m(offset_m);
  }

  template <class Thing, class Called>
  void tell_same_places(const std::string& what, std::vector<const Thing*> things, const Called& called) {
    std::ranges::stable_sort(things, {}, [](const Thing* one) { return std::pair(one->edge, one->offset_m); });
    for (size_t i = 1; i < things.size(); ++i) {
      const Thing& before = *things[i - 1];
      const Thing& one = *things[i];
      if (one.edge != before.edge || one.offset_m - before.offset_m > kSamePlaceM) continue;
      cuts_.push_back(what + " " + called(before) + " and " + called(one) + " are at the same place, " +
                      place_on(one.edge, one.offset_m));
    }
    tell_same_joints(what, things, called);
  }

  /// One at the end of an edge, the other where the next one begins. By place on each edge.
  template <class Thing, class Called>
  void tell_same_joints(const std::string& what, const std::vector<const Thing*>& things, const Called& called) {
    std::map<uint32_t, std::vector<std::pair<const Thing*, double>>> near;  // nodes: metres from there
    for (size_t i = 0; i < things.size(); ++i) {
      const Thing* one = things[i];
      const Edge* edge = map_.edge(one->edge);
      if (edge == nullptr) continue;
      const bool is_first = i == 0 || things[i - 1]->edge != one->edge;
      const bool is_last = i + 1 == things.size() || things[i + 1]->edge != one->edge;
      if (is_first) near[edge->from_node].emplace_back(one, one->offset_m);
      if (is_last) near[edge->to_node].emplace_back(one, edge->alignment.length_m() - one->offset_m);
    }
    for (const auto& [node, there] : near) {
      for (size_t i = 1; i < there.size(); ++i) {
        for (size_t before = 0; before < i; ++before) {
          const auto& [a, a_m] = there[before];
          const auto& [b, b_m] = there[i];
          if (a_m + b_m > kSamePlaceM || is_told_on_edge(*a, *b)) continue;
          cuts_.push_back(what + " " + called(*a) + " and " + called(*b) + " are at the same place, " +
                          place_on(a->edge, a->offset_m) + " and " + place_on(b->edge, b->offset_m));
        }
      }
    }
  }

  template <class Thing>
  static bool is_told_on_edge(const Thing& a, const Thing& b) {
    return a.edge == b.edge && std::abs(a.offset_m - b.offset_m) <= kSamePlaceM;
  }

  const Map& map_;
  std::map<uint32_t, const Node*> nodes_;
  std::map<uint32_t, std::vector<const Edge*>> ends_;
  std::set<std::pair<uint32_t, uint32_t>> connected_;  // node, edge
  std::vector<Bend> bends_;
  std::vector<std::string> cuts_;    // what a train cannot use or a reference cannot be trusted for
  std::vector<std::string> shapes_;  // told after them: often many, and trains can run there all the same
};

}  // namespace

std::vector<std::string> check_topology(const Map& map) {
  return Check(map).run();
}

}  // namespace railfix::track
