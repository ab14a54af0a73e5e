#include "track/import/meeting.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <optional>

#include "core/units.hpp"
#include "track/import/told.hpp"
#include "track/track_finder.hpp"

namespace railfix::track {
namespace {

constexpr double kFacingM = 50.0;
constexpr double kFacingRad = core::rad_from_deg(10.0);
constexpr double kBesideM = 2.0;  // the next track is farther away
// A branch that stops short of its switch, see turned_towards(). Nothing can stand so near to another track; farther
// away, yards have many buffer stops before the track that all others come together in.
constexpr double kShortBranchM = 3.0;
constexpr double kPointingM = 40.0;
constexpr double kSmallestBranchRad = core::rad_from_deg(1.0);
constexpr double kLargestBranchRad = core::rad_from_deg(15.0);
constexpr size_t kMostKinks = 10;
// Branches lie on the track that they leave, too, but not for so long.
constexpr double kLyingM = 0.05;
constexpr double kLyingRad = 0.02;
constexpr double kLyingEveryM = 50.0;
constexpr double kLeastLyingM = 100.0;

/// The pose of a train that leaves the edge over one of its ends.
PlanPose leaving(const Edge& edge, bool at_end) {
  return at_end ? edge.alignment.at(edge.alignment.length_m()).pose : turned_round(edge.alignment.at(0).pose);
}

struct LooseEnd {
  const Edge* edge = nullptr;
  uint32_t node = 0;
  PlanPose pose;
};

/// From west to east.
std::vector<LooseEnd> loose_ends(const Map& map) {
  std::vector<size_t> meeting(map.nodes.size() + 1, 0);
  for (const Edge& edge : map.edges) {
    for (const uint32_t node : {edge.from_node, edge.to_node}) {
      if (node < meeting.size()) ++meeting[node];
    }
  }
  std::vector<LooseEnd> out;
  for (const Edge& edge : map.edges) {
    if (edge.is_drawn) continue;
    for (const bool at_end : {false, true}) {
      const uint32_t node = at_end ? edge.to_node : edge.from_node;
      if (node >= meeting.size() || meeting[node] != 1) continue;
      const PlanPose pose = leaving(edge, at_end);
      if (std::isfinite(pose.easting_m + pose.northing_m)) out.push_back({&edge, node, pose});
    }
  }
  std::ranges::stable_sort(out, {}, [](const LooseEnd& end) { return end.pose.easting_m; });
  return out;
}

double distance_m(const LooseEnd& a, const LooseEnd& b) {
  return std::hypot(b.pose.easting_m - a.pose.easting_m, b.pose.northing_m - a.pose.northing_m);
}

/// Does track run on from one to the other? Seen along the middle of their headings, so that a curve counts, too: both
/// ends of an arc lie on one line there, those of two parallel tracks do not.
bool face_each_other(const LooseEnd& a, const LooseEnd& b) {
  const double turn = core::wrap_pi(b.pose.heading_rad + core::kPi - a.pose.heading_rad);
  if (std::abs(turn) > kFacingRad) return false;
  const double heading = a.pose.heading_rad + 0.5 * turn;
  const double east = b.pose.easting_m - a.pose.easting_m;
  const double north = b.pose.northing_m - a.pose.northing_m;
  const double ahead = east * std::sin(heading) + north * std::cos(heading);
  const double beside = east * std::cos(heading) - north * std::sin(heading);
  return ahead > 0 && ahead < kFacingM && std::abs(beside) < kBesideM && std::abs(beside) < ahead;
}

/// The nearest of the ends that this one faces; nullptr = none.
const LooseEnd* faced_by(const std::vector<LooseEnd>& ends, size_t own) {
  const LooseEnd* nearest = nullptr;
  const auto look_at = [&](const LooseEnd& other) {
    if (!face_each_other(ends[own], other)) return;
    if (nearest == nullptr || distance_m(ends[own], other) < distance_m(ends[own], *nearest)) nearest = &other;
  };
  const double easting_m = ends[own].pose.easting_m;
  for (size_t i = own; i-- > 0 && easting_m - ends[i].pose.easting_m < kFacingM;) look_at(ends[i]);
  for (size_t i = own + 1; i < ends.size() && ends[i].pose.easting_m - easting_m < kFacingM; ++i) look_at(ends[i]);
  return nearest;
}

/// By how much an end is turned towards a track beside it, as a branch is that stops short of its switch: straight on
/// it would soon meet that track, at an angle that switches have. Nothing for any other end: two tracks that run side
/// by side lead nowhere, and one that ends across another is a buffer stop.
std::optional<double> turned_towards(const LooseEnd& end, const Alignment& other, const NearTrack& near) {
  if (near.offset_m <= 0 || near.offset_m >= other.length_m()) return std::nullopt;  // beside its end, not beside it
  const double across = std::sin(end.pose.heading_rad - other.at(near.offset_m).pose.heading_rad);
  const double turn = std::asin(near.lateral_m > 0 ? across : -across);
  if (turn < kSmallestBranchRad || turn > kLargestBranchRad) return std::nullopt;
  if (std::abs(near.lateral_m) > kPointingM * std::sin(turn)) return std::nullopt;
  return turn;
}

/// An end that should meet another track.
struct NearMiss {
  const Edge* other = nullptr;
  std::string told;
};

std::optional<NearMiss> near_miss(const Map& map, const TrackFinder& tracks, const LooseEnd& end) {
  for (const NearTrack& near : tracks.near(end.pose.easting_m, end.pose.northing_m, kShortBranchM)) {
    const Edge& other = *map.edge(near.edge);
    if (other.is_drawn || &other == end.edge || other.from_node == end.node || other.to_node == end.node) continue;
    const double apart_m = std::abs(near.lateral_m);
    const std::string where = called(*end.edge) + " ends loose at node " + std::to_string(end.node) + ", only " +
                              told_m(apart_m) + " from " + called(other);
    if (apart_m <= kNearMissM) return NearMiss{&other, where};
    if (const auto turn = turned_towards(end, other.alignment, near))
      return NearMiss{&other, where + " and turned towards it by " + told_deg(*turn) +
                                  ": draw the switch between them, unless it is a buffer stop"};
  }
  return std::nullopt;
}

/// By how much a train turns at once on this way; the least of an edge that has both its ends there.
double kink_rad(const Map& map, const Connection& way) {
  const auto at_node = [&](uint32_t edge_id) {
    const Edge& edge = *map.edge(edge_id);
    std::vector<double> headings;
    if (edge.from_node == way.node) headings.push_back(leaving(edge, false).heading_rad);
    if (edge.to_node == way.node) headings.push_back(leaving(edge, true).heading_rad);
    return headings;
  };
  double least = core::kPi;
  for (const double a : at_node(way.edge_a)) {
    for (const double b : at_node(way.edge_b)) least = std::min(least, std::abs(core::wrap_pi(a + core::kPi - b)));
  }
  return least;
}

/// Does a train there run along the edge at the nearest place, either way?
bool lies_along(const Edge& edge, const NearTrack& nearest, const PlanPose& pose) {
  const double turn = edge.alignment.at(nearest.offset_m).pose.heading_rad - pose.heading_rad;
  return std::abs(std::sin(turn)) < kLyingRad;
}

struct Stretch {
  uint32_t other = 0;
  double from_m = 0;
  double to_m = 0;
};

/// Of the edge, on others of lower numbers; long ones.
std::vector<Stretch> stretches_on_others(const Map& map, const TrackFinder& tracks, const Edge& edge) {
  std::map<uint32_t, Stretch> running;  // up to the place before
  std::vector<Stretch> out;
  const auto end = [&](const Stretch& stretch) {
    if (stretch.to_m - stretch.from_m >= kLeastLyingM) out.push_back(stretch);
  };
  const double steps = std::ceil(edge.alignment.length_m() / kLyingEveryM);
  for (double i = 0; i <= steps; ++i) {
    const double offset_m = i / steps * edge.alignment.length_m();
    const PlanPose pose = edge.alignment.at(offset_m).pose;
    std::map<uint32_t, Stretch> here;
    for (const NearTrack& near : tracks.near(pose.easting_m, pose.northing_m, kLyingM)) {
      const Edge& other = *map.edge(near.edge);
      if (other.id >= edge.id || other.is_drawn || !lies_along(other, near, pose)) continue;
      const auto before = running.extract(other.id);
      here[other.id] = {other.id, before.empty() ? offset_m : before.mapped().from_m, offset_m};
    }
    for (const auto& [other, stretch] : running) end(stretch);
    running = std::move(here);
  }
  for (const auto& [other, stretch] : running) end(stretch);
  return out;
}

}  // namespace

std::vector<std::string> near_misses(const Map& map) {
  const TrackFinder tracks(std::shared_ptr<const Map>(std::shared_ptr<void>(), &map));  // the map outlives it
  std::vector<std::string> problems;
  std::vector<std::pair<LooseEnd, const Edge*>> told;  // and the track that it misses
  for (const LooseEnd& end : loose_ends(map)) {
    std::optional<NearMiss> miss = near_miss(map, tracks, end);
    if (!miss) continue;
    // Of two ends that miss each other one is enough.
    const auto is_told = [&](const auto& one) {
      return one.second == end.edge && miss->other == one.first.edge && distance_m(end, one.first) <= kNearMissM;
    };
    if (std::any_of(told.rbegin(), told.rend(), is_told)) continue;
    problems.push_back(std::move(miss->told));
    told.emplace_back(end, miss->other);
  }
  return problems;
}

size_t ends_on_edges_before(const Map& map, size_t first) {
  const TrackFinder tracks(std::shared_ptr<const Map>(std::shared_ptr<void>(), &map));  // the map outlives it
  size_t count = 0;
  for (size_t i = first; i < map.edges.size(); ++i) {
    if (map.edges[i].is_drawn) continue;
    for (const bool at_end : {false, true}) {
      const PlanPose pose = leaving(map.edges[i], at_end);
      const auto near = tracks.near(pose.easting_m, pose.northing_m, kLyingM);
      count += std::ranges::any_of(near, [&](const NearTrack& one) { return one.edge <= first; }) ? 1 : 0;
    }
  }
  return count;
}

std::vector<std::string> lying_on_others(const Map& map) {
  const TrackFinder tracks(std::shared_ptr<const Map>(std::shared_ptr<void>(), &map));  // the map outlives it
  std::vector<std::string> problems;
  for (const Edge& edge : map.edges) {
    if (edge.is_drawn || edge.alignment.length_m() < kLeastLyingM) continue;
    for (const Stretch& stretch : stretches_on_others(map, tracks, edge))
      problems.push_back(called(edge) + " lies on " + called(*map.edge(stretch.other)) + " from " +
                         told_m(stretch.from_m) + " to " + told_m(stretch.to_m) +
                         ": one track is there twice; leave one of them out");
  }
  return problems;
}

std::vector<std::string> facing_ends(const Map& map) {
  const std::vector<LooseEnd> ends = loose_ends(map);
  std::vector<std::string> problems;
  for (size_t i = 0; i < ends.size(); ++i) {
    const LooseEnd& own = ends[i];
    const LooseEnd* other = faced_by(ends, i);
    // Each pair once; around a turntable many ends face one.
    if (other == nullptr || other < &own || faced_by(ends, static_cast<size_t>(other - ends.data())) != &own) continue;
    const double gap_m = distance_m(own, *other);
    if (gap_m <= kNearMissM && own.edge != other->edge) continue;
    problems.push_back(called(*own.edge) + " and " + called(*other->edge) + " end loose at nodes " +
                       std::to_string(own.node) + " and " + std::to_string(other->node) + ", in line and " +
                       told_m(gap_m) +
                       " apart: draw the track between them, unless these are buffer stops or a turntable");
  }
  return problems;
}

std::vector<std::string> kinks_at_nodes(const Map& map) {
  std::vector<std::pair<double, const Connection*>> kinks;
  for (const Connection& way : map.connections) {
    const Edge* a = map.edge(way.edge_a);
    const Edge* b = map.edge(way.edge_b);
    if (a == nullptr || b == nullptr || a->is_drawn || b->is_drawn) continue;
    const double kink = kink_rad(map, way);
    if (kink > kKinkRad) kinks.emplace_back(kink, &way);
  }
  std::ranges::stable_sort(kinks, std::greater{}, [](const auto& kink) { return kink.first; });
  std::vector<std::string> problems;
  for (size_t i = 0; i < std::min(kMostKinks, kinks.size()); ++i) {
    const auto& [kink, way] = kinks[i];
    problems.push_back(called(*map.edge(way->edge_a)) + " and " + called(*map.edge(way->edge_b)) + " meet at node " +
                       std::to_string(way->node) + " with a kink of " + told_deg(kink) +
                       ": look at their points next to it");
  }
  if (kinks.size() > kMostKinks) {
    problems.push_back(std::to_string(kinks.size() - kMostKinks) + " more of " +
                       std::to_string(map.connections.size()) + " ways over nodes have a kink of " +
                       told_deg(kinks.back().first) + " to " + told_deg(kinks[kMostKinks].first) +
                       ": look at the points next to switches in the source");
  }
  return problems;
}

}  // namespace railfix::track
