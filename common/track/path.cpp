#include "track/path.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>
#include <unordered_map>

#include "core/units.hpp"

namespace railfix::track {
namespace {

constexpr size_t kMostLegs = 100000;  // ends a path round a ring of tiny edges
constexpr size_t kMostJoinSteps = 1000;
constexpr double kLongestJoinM = 30000;  // a wrong leg may have been followed for so long
constexpr double kKeptM = 200000;

// A train that runs for weeks would take its whole way along.
void drop_far(Route& route, double near_m) {
  while (route.legs().size() > 1 && route.legs().front().end_m() < near_m - kKeptM) route.drop_behind();
  while (route.legs().size() > 1 && route.legs().back().begin_m > near_m + kKeptM) route.drop_ahead();
}

/// Runs after the first until `distance_m` beyond the end of the first is covered or the track ends: over an edge of
/// `via` where one follows, else the straight way.
std::vector<Run> runs_after(const Junctions& junctions, const Run& first, double distance_m,
                            const std::vector<uint32_t>& via) {
  std::vector<Run> runs;
  Run run = first;
  while (distance_m > 0 && runs.size() < kMostLegs) {
    const std::vector<Run> next = junctions.after(run);
    if (next.empty()) break;
    const auto wanted =
        std::ranges::find_if(next, [&](const Run& way) { return std::ranges::find(via, way.edge->id) != via.end(); });
    run = wanted == next.end() ? next.front() : *wanted;
    runs.push_back(run);
    distance_m -= run.length_m();
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

}  // namespace

core::Result<Path> Path::follow(std::shared_ptr<const Map> map, const EdgePosition& start, double ahead_m,
                                double behind_m, const std::vector<uint32_t>& via) {
  const Edge* edge = map->edge(start.edge);
  if (edge == nullptr) return core::Error{"the map has no edge " + std::to_string(start.edge)};
  if (!(start.offset_m >= -1e-6 && start.offset_m <= edge->alignment.length_m() + 1e-6)) {
    return core::Error{"offset " + std::to_string(start.offset_m) + " m is not on edge " + std::to_string(start.edge)};
  }
  const Run started = run_of(*map, start);
  const double length = started.length_m();
  const double before = std::clamp(started.into_m(start.offset_m), 0.0, length);  // of the edge behind the start

  const Junctions junctions(*map);
  std::vector<Run> runs = runs_after(junctions, started.reversed(), behind_m - before, via);
  std::ranges::reverse(runs);
  double distance = -before;
  for (Run& run : runs) {
    run = run.reversed();
    distance -= run.length_m();
  }
  runs.push_back(started);
  std::ranges::copy(runs_after(junctions, started, ahead_m - (length - before), via), std::back_inserter(runs));

  Path path;
  path.map_ = std::move(map);
  const double begin = -std::max(behind_m, 0.0);
  const double end = std::max(ahead_m, 0.0);
  for (const Run& run : runs) {
    const double from = std::clamp(begin - distance, 0.0, run.length_m());  // into the run
    const double to = std::clamp(end - distance, 0.0, run.length_m());
    if (to > from || run.edge == edge) path.legs_.push_back({run, distance + from, to - from, run.offset_m(from)});
    distance += run.length_m();
  }
  path.collect_marks();
  path.collect_switches(junctions);
  return path;
}

Path Path::along(std::shared_ptr<const Map> map, const Route& route, const Ways& ways) {
  Path path;
  path.map_ = std::move(map);
  for (const auto& leg : route.legs())
    path.legs_.push_back({leg.run, leg.begin_m, leg.run.length_m(), leg.run.offset_m(0)});
  path.collect_marks();
  path.collect_switches(ways);
  return path;
}

Route Path::route() const {
  const Leg& first = legs_.front();
  Route route(first.run, first.offset_begin_m, first.begin_m);
  for (size_t i = 1; i < legs_.size(); ++i) route.push_ahead(legs_[i].run);
  return route;
}

std::optional<Path> followed_on(const Path& old, const Ways& ways, double near_m, double ahead_m, double behind_m) {
  Route route = old.route();
  const size_t legs = route.legs().size();
  const bool cut = route.end_m() > old.end_m() + 1e-6 || route.begin_m() < old.begin_m() - 1e-6;
  follow_on(route, ways, near_m, ahead_m, behind_m);
  if (route.legs().size() == legs && !cut) return std::nullopt;
  drop_far(route, near_m);
  return Path::along(old.shared_map(), route, ways);
}

std::optional<Rerouted> rerouted(const Path& old, const Ways& ways, const EdgePosition& place, double near_m,
                                 double ahead_m, double behind_m) {
  const Route old_route = old.route();
  const Run run = run_of(old.map(), place);
  const double into_m = run.into_m(place.offset_m);
  const auto off_m = [&](const Join& join) { return std::abs(join.place_m - near_m); };
  std::vector<Join> joins = joins_of(old_route, ways, run, into_m, true, near_m);
  std::ranges::move(joins_of(old_route, ways, run, into_m, false, near_m), std::back_inserter(joins));
  const auto best = std::ranges::min_element(joins, {}, off_m);
  if (best == joins.end() || off_m(*best) > kLongestJoinM) return std::nullopt;
  Route route = joined(old_route, *best);
  follow_on(route, ways, near_m, ahead_m, behind_m);
  drop_far(route, near_m);
  Rerouted found{Path::along(old.shared_map(), route, ways), {}};
  for (const Join& join : joins) {
    if (join.behind == best->behind && &join != &*best) found.otherwise_m.push_back(join.place_m);
  }
  return found;
}

void Path::collect_marks() {
  std::unordered_map<uint32_t, std::vector<const Leg*>> legs_on;
  for (const Leg& leg : legs_) legs_on[leg.run.edge->id].push_back(&leg);
  // Calls `take` with every leg that runs over the place, and its distance there.
  const auto each_pass = [&](uint32_t edge, double offset_m, const auto& take) {
    const auto found = legs_on.find(edge);
    if (found == legs_on.end()) return;
    for (const Leg* leg : found->second) {
      const double into = leg->into_m(offset_m);
      if (into >= -1e-6 && into <= leg->length_m + 1e-6) take(*leg, leg->begin_m + into);
    }
  };
  for (const Landmark& landmark : map_->landmarks) {
    each_pass(landmark.edge, landmark.offset_m, [&](const Leg& leg, double distance_m) {
      const double lateral_m = leg.run.forward ? landmark.lateral_m : -landmark.lateral_m;
      landmarks_.push_back({&landmark, distance_m, lateral_m, seen_along(landmark.kind, leg.run.forward)});
    });
  }
  for (const BaliseGroup& group : map_->balise_groups) {
    each_pass(group.edge, group.offset_m, [&](const Leg& leg, double distance_m) {
      groups_.push_back({&group, distance_m, group.nominal_is_forward == leg.run.forward});
    });
  }
  const auto by_distance = [](const auto& a, const auto& b) { return a.distance_m < b.distance_m; };
  std::stable_sort(landmarks_.begin(), landmarks_.end(), by_distance);
  std::stable_sort(groups_.begin(), groups_.end(), by_distance);
}

template <class Following>
void Path::collect_switches(const Following& following) {
  for (size_t i = 1; i < legs_.size(); ++i) {
    const auto ahead = following.after(legs_[i - 1].run).size();
    const auto behind = following.after(legs_[i].run.reversed()).size();
    if (ahead > 1) switches_.push_back({legs_[i].begin_m, true, static_cast<int>(ahead)});
    if (behind > 1) switches_.push_back({legs_[i].begin_m, false, static_cast<int>(behind)});
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

EdgePosition Path::position_at(double distance_m) const {
  const double distance = std::clamp(distance_m, begin_m(), end_m());
  const Leg& leg = leg_at(distance);
  return {leg.run.edge->id, std::clamp(leg.offset_at(distance), 0.0, leg.run.length_m()), leg.run.direction()};
}

std::optional<double> Path::distance_of(uint32_t edge, double offset_m) const {
  return distance_of({edge, offset_m, Direction::unknown}, 0);
}

std::optional<double> Path::distance_of(const EdgePosition& place, double near_m) const {
  std::optional<double> best;
  for (const Leg& leg : legs_) {
    if (leg.run.edge->id != place.edge) continue;
    if (place.direction != Direction::unknown && place.direction != leg.run.direction()) continue;
    const double into = leg.into_m(place.offset_m);
    if (into < -1e-6 || into > leg.length_m + 1e-6) continue;
    const double distance = leg.begin_m + into;
    if (!best || std::abs(distance - near_m) < std::abs(*best - near_m)) best = distance;
  }
  return best;
}

TrackPoint Path::at(double distance_m) const {
  const Leg& leg = leg_at(distance_m);
  TrackPoint point = leg.run.edge->alignment.at(leg.offset_at(distance_m));
  if (leg.run.forward) return point;
  // The rates keep their sign: quantity and direction both turn round.
  point.pose = turned_round(point.pose);
  point.curvature_per_m = -point.curvature_per_m;
  point.cant_m = -point.cant_m;
  point.grade = -point.grade;
  return point;
}

double Path::curvature_at(double distance_m) const {
  const Leg& leg = leg_at(distance_m);
  const double curvature = leg.run.edge->alignment.curvature_at(leg.offset_at(distance_m));
  return leg.run.forward ? curvature : -curvature;
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
  if (distance_m < begin_m() || distance_m > end_m()) return false;
  const Leg& leg = leg_at(distance_m);
  return leg.run.edge->alignment.grade_known_at(leg.offset_at(distance_m));
}

}  // namespace railfix::track
