// What a train can do at the end of every edge, and routes that take any of these ways. Path is the one way of a train
// that is known; a Route is one of several that are possible.
#pragma once

#include <deque>
#include <optional>
#include <vector>

#include "track/map.hpp"

namespace railfix::track {

/// An edge as it is run, forward = towards growing offsets.
struct Run {
  const Edge* edge = nullptr;
  bool forward = true;
  [[nodiscard]] Run reversed() const { return {edge, !forward}; }
  [[nodiscard]] double length_m() const { return edge->alignment.length_m(); }
  [[nodiscard]] Direction direction() const { return forward ? Direction::forward : Direction::reverse; }
  /// Metres run on the edge up to an offset, and the offset so many metres into it.
  [[nodiscard]] double into_m(double offset_m) const { return forward ? offset_m : length_m() - offset_m; }
  [[nodiscard]] double offset_m(double into_m) const { return forward ? into_m : length_m() - into_m; }
  [[nodiscard]] EdgePosition at(double into_m) const { return {edge->id, offset_m(into_m), direction()}; }
  /// Looking as it is run.
  [[nodiscard]] PlanPose pose_at(double into_m) const;
  friend bool operator==(const Run&, const Run&) = default;
};

/// Of a train there, unknown direction = forward. REQUIRES: the edge is on the map.
[[nodiscard]] Run run_of(const Map& map, const EdgePosition& place);

/// Where the cab of a train there is and looks. REQUIRES: the edge is on the map.
[[nodiscard]] PlanPose cab_pose(const Map& map, const EdgePosition& place);

/// By how much a train turns where it runs on from one onto the next, 0 to pi.
[[nodiscard]] double turn_rad(const Run& run, const Run& next);

/// Whether a train may run on from one onto the next where they meet: it turns no corner. Directions of a drawing say
/// nothing where it does not close.
[[nodiscard]] bool leads_on(const Run& run, const Run& next);

/// What a train can do at the end of one edge, found when it is asked for. The map must outlive it.
class Junctions {
 public:
  explicit Junctions(const Map& map);
  /// Runs that may follow, the straight way first (the one that the map calls straight, else the smallest turn).
  [[nodiscard]] std::vector<Run> after(const Run& run) const;

 private:
  const Map* map_;
  std::vector<const Connection*> by_node_;
};

/// The same of all edges, found once. The map must outlive it.
class Ways {
 public:
  explicit Ways(const Map& map);
  /// Runs that may follow, the straight way first.
  [[nodiscard]] const std::vector<Run>& after(const Run& run) const { return after_[index(run)]; }
  /// Runs that may come before, the straight way first.
  [[nodiscard]] std::vector<Run> before(const Run& run) const;

 private:
  static size_t index(const Run& run) { return 2 * (run.edge->id - 1) + (run.forward ? 0 : 1); }
  std::vector<std::vector<Run>> after_;
};

/// A chain of runs with a distance along it; what is read beyond its ends continues the last run.
class Route {
 public:
  struct Leg {
    Run run;
    double begin_m = 0;
    double corner_rad = 0;  // between the leg before and this one, left positive: a leg of a turnout that has no curve
    [[nodiscard]] double end_m() const { return begin_m + run.length_m(); }
    friend bool operator==(const Leg&, const Leg&) = default;
  };

  /// The run of a place, which gets the distance `place_m`.
  Route(const Run& run, double offset_m, double place_m);

  void push_ahead(const Run& run);
  void push_behind(const Run& run);
  /// One leg always stays.
  void drop_ahead();
  void drop_behind();

  [[nodiscard]] const std::deque<Leg>& legs() const { return legs_; }
  [[nodiscard]] double begin_m() const { return legs_.front().begin_m; }
  [[nodiscard]] double end_m() const { return legs_.back().end_m(); }
  [[nodiscard]] const Leg& leg_at(double distance_m) const { return legs_[index_at(distance_m)]; }
  [[nodiscard]] EdgePosition position_at(double distance_m) const;
  /// The place nearest to `near_m`, run in its direction (unknown: in either); nothing when the route does not go
  /// there.
  [[nodiscard]] std::optional<double> distance_of(const EdgePosition& place, double near_m) const;
  /// A corner counts as a curve of 12 m to either side: where a plan has a leg from the middle of its turnout (1 in 9
  /// of 190 m: 10.5 m, of 300 m: 16.6 m) the train turns as much. Path and the search of the whole map know no corners.
  [[nodiscard]] double curvature_at(double distance_m) const;

 private:
  [[nodiscard]] size_t index_at(double distance_m) const;
  /// Sum of the corners within 12 m; `at`: the leg of the distance.
  [[nodiscard]] double corners_at(size_t at, double distance_m) const;
  std::deque<Leg> legs_;
};

/// The straight way of every switch up to `ahead_m` and `behind_m` from `near_m`, or until the track ends.
void follow_on(Route& route, const Ways& ways, double near_m, double ahead_m, double behind_m);

}  // namespace railfix::track
