#include "track/path.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>
#include <unordered_map>

#include "core/units.hpp"

namespace railfix::track {
namespace {

constexpr int kMostLegs = 100000;  // ends a path round a ring of tiny edges
constexpr size_t kMostJoinSteps = 1000;
constexpr double kLongestJoinM = 30000;  // a wrong leg may have been followed for so long

/// The map's connections by their node.
using Meetings = std::unordered_map<uint32_t, std::vector<const Connection*>>;

Meetings meetings_of(const Map& map) {
  Meetings out;
  for (const Connection& connection : map.connections) out[connection.node].push_back(&connection);
  return out;
}

/// What follows at the end of a run: an edge of `via`, else the straight way, among several the one that turns least.
std::optional<Run> next_run(const Map& map, const Meetings& meetings, const Run& run,
                            const std::vector<uint32_t>& via) {
  const uint32_t node = run.forward ? run.edge->to_node : run.edge->from_node;
  std::optional<Run> best;
  double best_cost = 0;
  const auto here = meetings.find(node);
  if (here == meetings.end()) return best;
  for (const Connection* met : here->second) {
    const Connection& connection = *met;
    if (connection.edge_a != run.edge->id && connection.edge_b != run.edge->id) continue;
    const Edge* other = map.edge(connection.edge_a == run.edge->id ? connection.edge_b : connection.edge_a);
    for (const bool forward : {true, false}) {
      const Run candidate{other, forward};
      if ((forward ? other->from_node : other->to_node) != node) continue;
      const bool wanted = std::find(via.begin(), via.end(), other->id) != via.end();
      const double cost = turn_rad(run, candidate) + (connection.diverging ? 10.0 : 0.0) - (wanted ? 100.0 : 0.0);
      if (!best || cost < best_cost) {
        best = candidate;
        best_cost = cost;
      }
    }
  }
  return best;
}

/// Runs after the first until `distance_m` beyond the end of the first is covered or the track ends.
std::vector<Run> runs_after(const Map& map, const Meetings& meetings, const Run& first, double distance_m,
                            const std::vector<uint32_t>& via) {
  std::vector<Run> runs;
  Run run = first;
  while (distance_m > 0 && runs.size() < kMostLegs) {
    const std::optional<Run> next = next_run(map, meetings, run, via);
    if (!next) break;
    run = *next;
    runs.push_back(run);
    distance_m -= run.edge->alignment.length_m();
  }
  return runs;
}

/// A chain of runs by which an old route leads to a place behind or in front of it.
struct Join {
  bool behind = true;
  size_t leg = 0;          // of the old route: the one beside the chain
  std::vector<Run> chain;  // from that leg to the place's run
  double place_m = 0;      // on the old route's distances
};

/// All chains, those of few edges first, as far as they can be looked at. On a ring, which is run over several times,
/// each meets the leg that puts the place nearest to `near_m`.
std::vector<Join> joins_of(const Route& old, const Ways& ways, const Run& run, double into_m, bool behind,
                           double near_m) {
  struct Step {
    Run run;
    int next;         // towards `run`, -1 = it is `run`
    double length_m;  // from this run's far end to the place
  };
  std::map<std::pair<uint32_t, bool>, std::vector<size_t>> legs_on;
  for (size_t k = 0; k < old.legs().size(); ++k)
    legs_on[{old.legs()[k].run.edge->id, old.legs()[k].run.forward}].push_back(k);
  const auto place_m = [&](size_t leg, double length_m) {
    return behind ? old.legs()[leg].end_m() + length_m : old.legs()[leg].begin_m - length_m;
  };
  std::vector<Join> joins;
  std::vector<Step> steps{{run, -1, behind ? into_m : run.length_m() - into_m}};
  for (size_t i = 0; i < steps.size() && steps.size() < kMostJoinSteps; ++i) {
    const Step here = steps[i];
    if (here.length_m > kLongestJoinM) continue;
    for (const Run& next : behind ? ways.before(here.run) : ways.after(here.run)) {
      const auto met = legs_on.find({next.edge->id, next.forward});
      if (met == legs_on.end()) {
        steps.push_back({next, static_cast<int>(i), here.length_m + next.length_m()});
        continue;
      }
      const auto off_m = [&](size_t leg) { return std::abs(place_m(leg, here.length_m) - near_m); };
      const size_t leg = *std::ranges::min_element(met->second, {}, off_m);
      Join join{behind, leg, {}, place_m(leg, here.length_m)};
      for (int k = static_cast<int>(i); k >= 0; k = steps[static_cast<size_t>(k)].next)
        join.chain.push_back(steps[static_cast<size_t>(k)].run);
      joins.push_back(std::move(join));
    }
  }
  return joins;
}

Route joined(Route route, const Join& join) {
  if (join.behind) {
    while (route.legs().size() > join.leg + 1) route.drop_ahead();
  } else {
    for (size_t k = 0; k < join.leg; ++k) route.drop_behind();
  }
  for (const Run& run : join.chain) join.behind ? route.push_ahead(run) : route.push_behind(run);
  return route;
}

/// The straight way up to `ahead_m` and `behind_m` from `near_m`, or until the track ends.
void follow_on(Route& route, const Ways& ways, double near_m, double ahead_m, double behind_m) {
  while (route.end_m() < near_m + ahead_m && route.legs().size() < kMostLegs) {
    const auto& next = ways.after(route.legs().back().run);
    if (next.empty()) break;
    route.push_ahead(next.front());
  }
  while (route.begin_m() > near_m - behind_m && route.legs().size() < kMostLegs) {
    const auto before = ways.before(route.legs().front().run);
    if (before.empty()) break;
    route.push_behind(before.front());
  }
}

}  // namespace

core::Result<Path> Path::follow(std::shared_ptr<const Map> map, const EdgePosition& start, double ahead_m,
                                double behind_m, const std::vector<uint32_t>& via) {
  const Edge* edge = map->edge(start.edge);
  if (edge == nullptr) return core::Error{"the map has no edge " + std::to_string(start.edge)};
  if (!(start.offset_m >= -1e-6 && start.offset_m <= edge->alignment.length_m() + 1e-6)) {
    return core::Error{"offset " + std::to_string(start.offset_m) + " m is not on edge " + std::to_string(start.edge)};
  }
  const bool forward = start.direction != Direction::reverse;
  const double length = edge->alignment.length_m();
  const double before =
      std::clamp(forward ? start.offset_m : length - start.offset_m, 0.0, length);  // of the edge behind the start

  const Meetings meetings = meetings_of(*map);
  std::vector<Run> runs = runs_after(*map, meetings, {edge, !forward}, behind_m - before, via);
  std::reverse(runs.begin(), runs.end());
  double distance = -before;
  for (Run& run : runs) {
    run.forward = !run.forward;
    distance -= run.edge->alignment.length_m();
  }
  runs.push_back({edge, forward});
  const std::vector<Run> ahead = runs_after(*map, meetings, {edge, forward}, ahead_m - (length - before), via);
  runs.insert(runs.end(), ahead.begin(), ahead.end());

  Path path;
  path.map_ = std::move(map);
  const double begin = -std::max(behind_m, 0.0);
  const double end = std::max(ahead_m, 0.0);
  for (const Run& run : runs) {
    const double run_length = run.edge->alignment.length_m();
    const double from = std::clamp(begin - distance, 0.0, run_length);  // into the run
    const double to = std::clamp(end - distance, 0.0, run_length);
    if (to > from || run.edge == edge) {
      path.legs_.push_back({run.edge, run.forward, distance + from, to - from, run.forward ? from : run_length - from});
    }
    distance += run_length;
  }
  path.collect_marks();
  return path;
}

Path Path::along(std::shared_ptr<const Map> map, const Route& route) {
  Path path;
  path.map_ = std::move(map);
  for (const auto& leg : route.legs()) {
    const double length_m = leg.run.length_m();
    path.legs_.push_back({leg.run.edge, leg.run.forward, leg.begin_m, length_m, leg.run.forward ? 0.0 : length_m});
  }
  path.collect_marks();
  return path;
}

Route Path::route() const {
  const Leg& first = legs_.front();
  Route route({first.edge, first.forward}, first.offset_begin_m, first.begin_m);
  for (size_t i = 1; i < legs_.size(); ++i) route.push_ahead({legs_[i].edge, legs_[i].forward});
  return route;
}

std::optional<Path> followed_on(const Path& old, const Ways& ways, double near_m, double ahead_m, double behind_m) {
  Route route = old.route();
  const size_t legs = route.legs().size();
  const bool cut = route.end_m() > old.end_m() + 1e-6 || route.begin_m() < old.begin_m() - 1e-6;
  follow_on(route, ways, near_m, ahead_m, behind_m);
  if (route.legs().size() == legs && !cut) return std::nullopt;
  return Path::along(old.shared_map(), route);
}

std::optional<Rerouted> rerouted(const Path& old, const Ways& ways, const EdgePosition& place, double near_m,
                                 double ahead_m, double behind_m) {
  const Route old_route = old.route();
  const Run run{old.map().edge(place.edge), place.direction != Direction::reverse};
  const double into_m = run.forward ? place.offset_m : run.length_m() - place.offset_m;
  const auto off_m = [&](const Join& join) { return std::abs(join.place_m - near_m); };
  std::vector<Join> joins = joins_of(old_route, ways, run, into_m, true, near_m);
  std::ranges::move(joins_of(old_route, ways, run, into_m, false, near_m), std::back_inserter(joins));
  const auto best = std::ranges::min_element(joins, {}, off_m);
  if (best == joins.end() || off_m(*best) > kLongestJoinM) return std::nullopt;
  Route route = joined(old_route, *best);
  follow_on(route, ways, near_m, ahead_m, behind_m);
  Rerouted found{Path::along(old.shared_map(), route), {}};
  for (const Join& join : joins) {
    if (join.behind == best->behind && &join != &*best) found.otherwise_m.push_back(join.place_m);
  }
  return found;
}

void Path::collect_marks() {
  std::unordered_map<uint32_t, std::vector<const Leg*>> legs_on;
  for (const Leg& leg : legs_) legs_on[leg.edge->id].push_back(&leg);
  // Calls `take` with every leg that runs over the place, and its distance there.
  const auto each_pass = [&](uint32_t edge, double offset_m, const auto& take) {
    const auto found = legs_on.find(edge);
    if (found == legs_on.end()) return;
    for (const Leg* leg : found->second) {
      const double into = (leg->forward ? 1.0 : -1.0) * (offset_m - leg->offset_begin_m);
      if (into >= -1e-6 && into <= leg->length_m + 1e-6) take(*leg, leg->begin_m + into);
    }
  };
  for (const Landmark& landmark : map_->landmarks) {
    each_pass(landmark.edge, landmark.offset_m, [&](const Leg& leg, double distance_m) {
      const double lateral_m = leg.forward ? landmark.lateral_m : -landmark.lateral_m;
      landmarks_.push_back({&landmark, distance_m, lateral_m, seen_along(landmark.kind, leg.forward)});
    });
  }
  for (const BaliseGroup& group : map_->balise_groups) {
    each_pass(group.edge, group.offset_m, [&](const Leg& leg, double distance_m) {
      groups_.push_back({&group, distance_m, group.nominal_is_forward == leg.forward});
    });
  }
  const auto by_distance = [](const auto& a, const auto& b) { return a.distance_m < b.distance_m; };
  std::stable_sort(landmarks_.begin(), landmarks_.end(), by_distance);
  std::stable_sort(groups_.begin(), groups_.end(), by_distance);
  collect_switches();
}

void Path::collect_switches() {
  std::unordered_map<uint32_t, std::vector<const Connection*>> at_node;
  const auto node_before = [](const Leg& leg) { return leg.forward ? leg.edge->from_node : leg.edge->to_node; };
  for (size_t i = 1; i < legs_.size(); ++i) at_node[node_before(legs_[i])];
  for (const Connection& connection : map_->connections) {
    const auto found = at_node.find(connection.node);
    if (found != at_node.end()) found->second.push_back(&connection);
  }
  const auto ways_after = [&](const Run& run, uint32_t node) {
    int ways = 0;
    for (const Connection* connection : at_node[node]) {
      if (connection->edge_a != run.edge->id && connection->edge_b != run.edge->id) continue;
      const Edge* other = map_->edge(connection->edge_a == run.edge->id ? connection->edge_b : connection->edge_a);
      if (other == nullptr) continue;
      for (const bool forward : {true, false}) {
        const Run next{other, forward};
        if ((forward ? other->from_node : other->to_node) != node || next == run.reversed()) continue;
        ways += leads_on(run, next) ? 1 : 0;
      }
    }
    return ways;
  };
  for (size_t i = 1; i < legs_.size(); ++i) {
    const uint32_t node = node_before(legs_[i]);
    const int ahead = ways_after({legs_[i - 1].edge, legs_[i - 1].forward}, node);
    const int behind = ways_after({legs_[i].edge, !legs_[i].forward}, node);
    if (ahead > 1) switches_.push_back({legs_[i].begin_m, true, ahead});
    if (behind > 1) switches_.push_back({legs_[i].begin_m, false, behind});
  }
}

double Path::begin_m() const {
  return legs_.front().begin_m;
}
double Path::end_m() const {
  return legs_.back().begin_m + legs_.back().length_m;
}

const Path::Leg& Path::leg_at(double distance_m) const {
  const auto after = std::upper_bound(legs_.begin(), legs_.end(), distance_m,
                                      [](double distance, const Leg& leg) { return distance < leg.begin_m; });
  return after == legs_.begin() ? legs_.front() : *(after - 1);
}

double Path::offset_on(const Leg& leg, double distance_m) {
  return leg.offset_begin_m + (leg.forward ? 1.0 : -1.0) * (distance_m - leg.begin_m);
}

EdgePosition Path::position_at(double distance_m) const {
  const double distance = std::clamp(distance_m, begin_m(), end_m());
  const Leg& leg = leg_at(distance);
  const double offset = std::clamp(offset_on(leg, distance), 0.0, leg.edge->alignment.length_m());
  return {leg.edge->id, offset, leg.forward ? Direction::forward : Direction::reverse};
}

std::optional<double> Path::distance_of(uint32_t edge, double offset_m) const {
  return distance_of({edge, offset_m, Direction::unknown}, 0);
}

std::optional<double> Path::distance_of(const EdgePosition& place, double near_m) const {
  std::optional<double> best;
  for (const Leg& leg : legs_) {
    if (leg.edge->id != place.edge) continue;
    if (place.direction != Direction::unknown && leg.forward != (place.direction == Direction::forward)) continue;
    const double into = (leg.forward ? 1.0 : -1.0) * (place.offset_m - leg.offset_begin_m);
    if (into < -1e-6 || into > leg.length_m + 1e-6) continue;
    const double distance = leg.begin_m + into;
    if (!best || std::abs(distance - near_m) < std::abs(*best - near_m)) best = distance;
  }
  return best;
}

TrackPoint Path::at(double distance_m) const {
  const Leg& leg = leg_at(distance_m);
  TrackPoint point = leg.edge->alignment.at(offset_on(leg, distance_m));
  if (leg.forward) return point;
  // The rates keep their sign: quantity and direction both turn round.
  point.pose.heading_rad = core::wrap_pi(point.pose.heading_rad + core::kPi);
  point.curvature_per_m = -point.curvature_per_m;
  point.cant_m = -point.cant_m;
  point.grade = -point.grade;
  return point;
}

std::optional<double> Path::speed_limit_at(double distance_m) const {
  const Leg& leg = leg_at(distance_m);
  return leg.edge->speed_limit_mps(offset_on(leg, distance_m), leg.forward ? Direction::forward : Direction::reverse);
}

double Path::curvature_at(double distance_m) const {
  const Leg& leg = leg_at(distance_m);
  const double curvature = leg.edge->alignment.curvature_at(offset_on(leg, distance_m));
  return leg.forward ? curvature : -curvature;
}

std::span<const PathLandmark> Path::landmarks_between(double from_m, double to_m) const {
  const auto first = std::lower_bound(
      landmarks_.begin(), landmarks_.end(), from_m,
      [](const PathLandmark& landmark, double distance_m) { return landmark.distance_m < distance_m; });
  const auto end = std::upper_bound(first, landmarks_.end(), to_m, [](double distance_m, const PathLandmark& landmark) {
    return distance_m < landmark.distance_m;
  });
  return {first, end};
}

bool Path::grade_known_at(double distance_m) const {
  return distance_m >= begin_m() && distance_m <= end_m() && !leg_at(distance_m).edge->alignment.profile().empty();
}

}  // namespace railfix::track
