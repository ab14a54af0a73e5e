#include "track/import/xml/rail_net.hpp"

#include <algorithm>
#include <cmath>
#include <deque>
#include <map>
#include <numeric>
#include <set>

#include "core/units.hpp"
#include "track/import/fit/biarc.hpp"
#include "track/import/made/made_lines.hpp"
#include "track/import/told.hpp"
#include "track/import/xml/net_heights.hpp"
#include "track/import/xml/net_plan.hpp"

namespace railfix::track {
namespace {

constexpr double kTurnoutRadiusM = 300.0;
constexpr double kBesideM = 4.5;  // schematic tracks
constexpr double kLengthToldM = 1.0;
constexpr double kLengthToldPart = 1e-3;
constexpr double kNextPlanM = 500.0;  // between schematic plans that are not connected

Alignment reversed(const Alignment& track) {
  std::vector<Element> elements;
  std::vector<PlanPose> starts;
  for (size_t i = track.elements().size(); i-- > 0;) {
    const Element& element = track.elements()[i];
    elements.push_back({element.length_m, -element.curvature_end_per_m, -element.curvature_start_per_m});
    starts.push_back(turned_round(advance(track.starts()[i], element, element.length_m)));
  }
  return {std::move(elements), std::move(starts), {}, {}};
}

/// Straights and bends over the whole length.
std::vector<Element> plan_of(const NetTrack& track) {
  std::vector<Element> out;
  double reached = 0;
  const auto add = [&](double to, double start, double end) {
    if (to - reached < 1e-6) return;
    out.push_back({to - reached, start, end});
    reached = to;
  };
  for (const NetBend& bend : track.bends) {
    add(std::clamp(bend.from_m, reached, track.length_m), 0, 0);
    add(std::clamp(bend.to_m, reached, track.length_m), bend.curvature_start_per_m, bend.curvature_end_per_m);
  }
  add(track.length_m, 0, 0);
  return out;
}

class Planner {
 public:
  explicit Planner(RailNet& net) : net_(net), node_of_(2 * net.tracks.size()) {
    std::iota(node_of_.begin(), node_of_.end(), 0U);
    for (const NetLink& link : net.links) {
      node_of_[root(key(link.a))] = root(key(link.b));
      links_at_[link.a].push_back({&link, link.b});
      links_at_[link.b].push_back({&link, link.a});
    }
  }

  Draft make() {
    size_t schematic = 0;
    for (NetTrack& track : net_.tracks) {
      if (track.has_shape()) fit_shape(track);
    }
    double begin_northing = 0;
    for (size_t i = 0; i < net_.tracks.size(); ++i) {
      if (is_laid(i)) continue;
      schematic += lay_from(i, begin_northing);
      begin_northing -= kNextPlanM;
    }
    if (schematic > 0) {
      net_.problems.push_back(std::to_string(schematic) + " of " + std::to_string(net_.tracks.size()) +
                              " tracks have no coordinates; their lengths and links are right, but they are laid out "
                              "as a drawing, from the radii if there are any");
    }
    add_heights();
    return joined();
  }

 private:
  struct Neighbour {
    const NetLink* link = nullptr;
    NetEnd other;
  };

  [[nodiscard]] static size_t key(const NetEnd& end) { return 2 * end.track + (end.at_end ? 1 : 0); }
  size_t root(size_t item) {
    while (node_of_[item] != item) item = node_of_[item] = node_of_[node_of_[item]];
    return item;
  }
  [[nodiscard]] bool is_laid(size_t track) const { return !net_.tracks[track].track.alignment.elements().empty(); }

  void fit_shape(NetTrack& track) {
    std::optional<ClothoidFit> smooth = own_plan(track, net_.problems);
    if (!smooth) smooth = fit_drawing(track.shape, {});
    if (smooth) {
      net_.fit.add(track.track.name, *smooth, track.shape.size());
      if (smooth->left_out > 0) {
        net_.problems.push_back("track " + track.track.name + " has " +
                                told_left_out(smooth->left_out, smooth->left_out_max_m));
      }
      track.track.alignment = std::move(smooth->alignment);
      return;
    }
    ++net_.fit.left_as_arcs;
    PolylineFit fit = fit_polyline(thinned(track.shape), std::nullopt, std::nullopt);
    net_.figures.include(fit.figures);
    if (fit.straightened > 0) {
      net_.problems.push_back("track " + track.track.name + " has " + std::to_string(fit.straightened) +
                              " stretches with points too crooked for a track; they are straight lines now");
    }
    for (const Eigen::Vector2d& point : track.shape) {
      net_.figures.max_point_distance_m =
          std::max(net_.figures.max_point_distance_m, std::abs(fit.alignment.nearest(point.x(), point.y()).lateral_m));
    }
    track.track.alignment = std::move(fit.alignment);
  }

  /// Lays a track and all that hangs on it; returns how many.
  size_t lay_from(size_t first, double northing_m) {
    std::deque<size_t> waiting;
    size_t count = 0;
    const auto lay = [&](const NetEnd& from, const PlanPose& pose, double side) {
      lay_track(from, pose, side);
      waiting.push_back(from.track);
      ++count;
    };
    const std::optional<std::pair<NetEnd, PlanPose>> anchor = laid_neighbour(first);
    if (anchor) {
      lay(anchor->first, anchor->second, 0);
    } else {
      lay({first, false}, {0, northing_m, 0.5 * core::kPi}, 0);
    }
    while (!waiting.empty()) {
      const size_t track = waiting.front();
      waiting.pop_front();
      for (const bool at_end : {true, false}) {
        for (const Neighbour& next : links_at_[{track, at_end}]) {
          if (!next.link->passable || is_laid(next.other.track)) continue;
          lay(next.other, leaving({track, at_end}), next.link->diverging ? next.link->side : 0.0);
        }
      }
    }
    return count;
  }

  [[nodiscard]] std::optional<std::pair<NetEnd, PlanPose>> laid_neighbour(size_t track) {
    for (const bool at_end : {false, true}) {
      for (const Neighbour& next : links_at_[{track, at_end}]) {
        if (next.link->passable && is_laid(next.other.track))
          return std::pair(NetEnd{track, at_end}, leaving(next.other));
      }
    }
    return std::nullopt;
  }

  /// The pose of a train that runs off this end.
  [[nodiscard]] PlanPose leaving(const NetEnd& end) const {
    const Alignment& track = net_.tracks[end.track].track.alignment;
    return end.at_end ? track.at(track.length_m()).pose : turned_round(track.at(0).pose);
  }

  /// Lays a track entered at `from`. A branch steps aside onto a parallel, and back where its far end is one too.
  void lay_track(const NetEnd& from, const PlanPose& pose, double side) {
    NetTrack& track = net_.tracks[from.track];
    track.track.is_drawn = true;
    std::vector<Element> elements = plan_of(track);
    if (from.at_end) {
      const std::vector<Element> forward = elements;
      elements.clear();
      for (auto element = forward.rbegin(); element != forward.rend(); ++element)
        elements.push_back({element->length_m, -element->curvature_end_per_m, -element->curvature_start_per_m});
    }
    if (track.bends.empty() && side != 0) elements = beside(track.length_m, side, comes_back(from));
    const Alignment run = Alignment::chained(pose, elements);
    track.track.alignment = from.at_end ? reversed(run) : run;
  }

  [[nodiscard]] bool comes_back(const NetEnd& from) {
    const std::vector<Neighbour>& far = links_at_[{from.track, !from.at_end}];
    return std::any_of(far.begin(), far.end(), [](const Neighbour& next) { return next.link->diverging; });
  }

  static std::vector<Element> beside(double length_m, double side, bool comes_back) {
    std::vector<Element> out = sideways(side * kBesideM, kTurnoutRadiusM);
    const double swing = out[0].length_m + out[1].length_m;
    const double straight = length_m - swing * (comes_back ? 2.0 : 1.0);
    if (straight < 1.0) return {{length_m, side / kTurnoutRadiusM, side / kTurnoutRadiusM}};
    out.push_back({straight, 0, 0});
    if (comes_back) {
      const std::vector<Element> back = sideways(-side * kBesideM, kTurnoutRadiusM);
      out.insert(out.end(), back.begin(), back.end());
    }
    return out;
  }

  void add_heights() {
    std::vector<std::pair<size_t, size_t>> nodes;
    for (size_t i = 0; i < net_.tracks.size(); ++i) nodes.emplace_back(root(key({i, false})), root(key({i, true})));
    std::vector<std::vector<GradePoint>> profiles = net_profiles(net_, nodes);
    for (size_t i = 0; i < net_.tracks.size(); ++i) finish_track(net_.tracks[i], std::move(profiles[i]));
  }

  void finish_track(NetTrack& track, std::vector<GradePoint> profile) {
    const Alignment& plan = track.track.alignment;
    const double scale = plan.length_m() / track.length_m;
    if (std::abs(plan.length_m() - track.length_m) > std::max(kLengthToldM, kLengthToldPart * track.length_m)) {
      net_.problems.push_back("track " + track.track.name + " is " + told_m(plan.length_m()) +
                              " long by its coordinates but " + told_m(track.length_m) +
                              " by the source; places on it are spread evenly");
    }
    for (CantPoint& point : track.cant) point.offset_m *= scale;
    track.track.alignment = Alignment(plan.elements(), plan.starts(), std::move(profile), std::move(track.cant));
    for (TrackMark& mark : track.track.marks) place(mark, scale, track.track.alignment.length_m());
    for (SpeedLimit& limit : track.track.speed_limits) {
      limit.from_m = std::clamp(limit.from_m * scale, 0.0, track.track.alignment.length_m());
      limit.to_m = std::clamp(limit.to_m * scale, 0.0, track.track.alignment.length_m());
    }
    for (TrackGroup& group : track.track.groups) {
      group.offset_m = std::clamp(group.offset_m * scale, 0.0, track.track.alignment.length_m());
      for (TrackMark& balise : group.balises) place(balise, scale, track.track.alignment.length_m());
    }
  }

  static void place(TrackMark& mark, double scale, double length_m) {
    mark.offset_m = std::clamp(mark.offset_m * scale, 0.0, length_m);
  }

  Draft joined() {
    Draft draft;
    std::map<size_t, size_t> index;  // of the draft's nodes
    const auto node = [&](const NetEnd& end) {
      const auto [entry, is_new] = index.try_emplace(root(key(end)), draft.nodes.size());
      const PlanPose pose = leaving(end);
      if (is_new) draft.nodes.push_back({"", pose.easting_m, pose.northing_m});
      return entry->second;
    };
    for (size_t i = 0; i < net_.tracks.size(); ++i) {
      const ImportedTrack& track = net_.tracks[i].track;
      const size_t from = node({i, false});
      const size_t to = node({i, true});
      add_pieces(track, {{0, from}, {track.alignment.length_m(), to}}, draft);
    }
    for (const NetLink& link : net_.links) {
      DraftNode& at = draft.nodes[node(link.a)];
      at.ways_are_told = true;
      if (link.passable && !link.crosses)
        at.ways.push_back({{link.a.track, link.a.at_end}, {link.b.track, link.b.at_end}, link.diverging});
      if (link.switch_name.empty()) continue;
      at.name = link.switch_name;
      at.is_switch = true;
    }
    for (DraftNode& at : draft.nodes) at.is_crossing = is_crossed(at);
    return draft;
  }

  /// Several ways lead over it, and no two of them meet.
  static bool is_crossed(const DraftNode& node) {
    std::set<std::pair<size_t, bool>> met;
    for (const ToldWay& way : node.ways) {
      if (!met.insert(way.a).second || !met.insert(way.b).second) return false;
    }
    return node.ways.size() > 1;
  }

  RailNet& net_;
  std::vector<size_t> node_of_;  // union-find over the ends
  std::map<NetEnd, std::vector<Neighbour>> links_at_;
};

template <class Item>
std::vector<Item> taken_from(std::vector<Item>& items, double offset_m) {
  std::vector<Item> out;
  for (Item& item : items) {
    if (item.offset_m < offset_m) continue;
    out.push_back(item);
    out.back().offset_m -= offset_m;
  }
  std::erase_if(items, [&](const Item& item) { return item.offset_m >= offset_m; });
  return out;
}

}  // namespace

Draft draft_of(RailNet& net) {
  return Planner(net).make();
}

size_t split(RailNet& net, size_t track, double offset_m, const std::string& name) {
  NetTrack rest;
  NetTrack& first = net.tracks[track];
  rest.track.name = name;
  rest.track.line = first.track.line;
  rest.length_m = first.length_m - offset_m;
  first.length_m = offset_m;
  rest.track.marks = taken_from(first.track.marks, offset_m);
  rest.track.groups = taken_from(first.track.groups, offset_m);
  for (TrackGroup& group : rest.track.groups) {
    for (TrackMark& balise : group.balises) balise.offset_m -= offset_m;
  }
  for (SpeedLimit& limit : first.track.speed_limits) {
    if (limit.to_m <= offset_m) continue;
    rest.track.speed_limits.push_back(
        {std::max(limit.from_m - offset_m, 0.0), limit.to_m - offset_m, limit.speed_mps, limit.direction});
    limit.to_m = offset_m;
  }
  std::erase_if(first.track.speed_limits, [](const SpeedLimit& limit) { return limit.from_m >= limit.to_m; });
  rest.slopes = taken_from(first.slopes, offset_m);
  if (!first.slopes.empty()) rest.slopes.insert(rest.slopes.begin(), {0, first.slopes.back().grade});
  rest.cant = points_between(first.cant, offset_m, offset_m + rest.length_m);
  first.cant = points_between(first.cant, 0, offset_m);
  for (NetBend& bend : first.bends) {
    if (bend.to_m <= offset_m) continue;
    NetBend after{std::max(0.0, bend.from_m - offset_m), bend.to_m - offset_m, bend.curvature_start_per_m,
                  bend.curvature_end_per_m};
    if (bend.from_m < offset_m) {
      const double part = (offset_m - bend.from_m) / (bend.to_m - bend.from_m);
      after.curvature_start_per_m += part * (bend.curvature_end_per_m - bend.curvature_start_per_m);
      bend.to_m = offset_m;
      bend.curvature_end_per_m = after.curvature_start_per_m;
    }
    rest.bends.push_back(after);
  }
  std::erase_if(first.bends, [&](const NetBend& bend) { return bend.from_m >= offset_m; });
  net.tracks.push_back(std::move(rest));
  const size_t added = net.tracks.size() - 1;
  for (NetLink& link : net.links) {
    for (NetEnd* end : {&link.a, &link.b}) {
      if (end->track == track && end->at_end) end->track = added;
    }
  }
  net.links.push_back({.a = {track, true}, .b = {added, false}, .diverging = false, .side = 0, .switch_name = ""});
  return added;
}

}  // namespace railfix::track
