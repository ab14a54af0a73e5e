// One way through the network: a chain of edges with a distance of its own, as a train runs it.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "core/result.hpp"
#include "track/map.hpp"
#include "track/ways.hpp"

namespace railfix::track {

/// A landmark or balise group at its distance on a path; lateral is seen along the path (left positive).
struct PathLandmark {
  const Landmark* landmark = nullptr;
  double distance_m = 0;
  double lateral_m = 0;
  LandmarkKind kind = LandmarkKind::unknown;  // as met along the path: a portal in is a portal out the other way
};
struct PathBaliseGroup {
  const BaliseGroup* group = nullptr;
  double distance_m = 0;
  bool nominal_is_along_path = true;
};

/// Where the track divides: more than one way for a train that comes from smaller distances (ahead) or from larger
/// ones.
struct PathSwitch {
  double distance_m = 0;
  bool ahead = true;
  int ways = 2;
};

/// Distance 0 is where the path was started, which a long one may have left; it is negative behind it. Read-only after
/// it is made; keeps the map alive.
class Path {
 public:
  /// Follows the track from `start` (its direction, unknown = forward) over the straight way of every switch, `ahead_m`
  /// in front and `behind_m` behind, or until the track ends. Where the straight way is not told, the smallest turn is
  /// taken. Edges in `via` (ids) are taken wherever a switch leads to one of them.
  static core::Result<Path> follow(std::shared_ptr<const Map> map, const EdgePosition& start, double ahead_m,
                                   double behind_m, const std::vector<uint32_t>& via = {});

  /// The way of a route with the route's distances.
  static Path along(std::shared_ptr<const Map> map, const Route& route, const Ways& ways);
  /// This way as whole edges, with the same distances.
  [[nodiscard]] Route route() const;

  [[nodiscard]] double begin_m() const;  // smallest distance
  [[nodiscard]] double end_m() const;
  [[nodiscard]] EdgePosition position_at(double distance_m) const;  // clamped to the ends
  /// Distance of a place on the map, the one nearest to 0 on a ring; nothing when the path does not run over it.
  [[nodiscard]] std::optional<double> distance_of(uint32_t edge, double offset_m) const;
  /// The same for a train there, the one nearest to `near_m`: where the path runs over the place more than once, or
  /// round a loop the other way, only the passes in its direction count (unknown = either).
  [[nodiscard]] std::optional<double> distance_of(const EdgePosition& place, double near_m) const;
  /// Geometry seen along the path: heading, curvature, grade and cant have the sign of the path's direction.
  [[nodiscard]] TrackPoint at(double distance_m) const;
  [[nodiscard]] double curvature_at(double distance_m) const;
  /// False where the map has no heights or guesses them, and beyond its end.
  [[nodiscard]] bool grade_known_at(double distance_m) const;
  [[nodiscard]] const std::vector<PathLandmark>& landmarks() const { return landmarks_; }  // by distance
  /// With those that lie at either end.
  [[nodiscard]] std::span<const PathLandmark> landmarks_between(double from_m, double to_m) const;
  [[nodiscard]] const std::vector<PathBaliseGroup>& balise_groups() const { return groups_; }
  [[nodiscard]] const std::vector<PathSwitch>& switches() const { return switches_; }  // by distance
  [[nodiscard]] const Map& map() const { return *map_; }

 private:
  struct Leg {
    Run run;
    double begin_m = 0;  // path distance where the leg begins
    double length_m = 0;
    double offset_begin_m = 0;  // edge offset at begin_m
    [[nodiscard]] double into_m(double offset_m) const { return sign() * (offset_m - offset_begin_m); }
    [[nodiscard]] double offset_at(double distance_m) const { return offset_begin_m + sign() * (distance_m - begin_m); }
    [[nodiscard]] double sign() const { return run.forward ? 1.0 : -1.0; }
  };
  [[nodiscard]] const Leg& leg_at(double distance_m) const;
  [[nodiscard]] const std::shared_ptr<const Map>& shared_map() const { return map_; }
  friend std::optional<Path> followed_on(const Path& old, const Ways& ways, double near_m, double ahead_m,
                                         double behind_m);
  friend std::optional<struct Rerouted> rerouted(const Path& old, const Ways& ways, const EdgePosition& place,
                                                 double near_m, double ahead_m, double behind_m);
  void collect_marks();
  /// Of Ways or Junctions.
  template <class Following>
  void collect_switches(const Following& following);
  std::shared_ptr<const Map> map_;
  std::vector<Leg> legs_;
  std::vector<PathLandmark> landmarks_;
  std::vector<PathBaliseGroup> groups_;
  std::vector<PathSwitch> switches_;
};

/// The same way with the same distances, followed on over the straight way of every switch up to `ahead_m` and
/// `behind_m` from `near_m`; what lies 200 km from there is left out. Nothing when the track ends before, or it reaches
/// so far.
std::optional<Path> followed_on(const Path& old, const Ways& ways, double near_m, double ahead_m, double behind_m);

/// A way that was joined to an old one, and where on its distances the place lies over other ways that lead there.
struct Rerouted {
  Path path;
  std::vector<double> otherwise_m;
};

/// The way of a train that is on another track than `old` says: through `place`, joined to the old way where that leads
/// there (behind or in front), with distances that go on from it, and the straight way up to `ahead_m` and `behind_m`
/// from there. Of several ways that lead there the one on which the place is nearest to `near_m`, where the train is.
/// Nothing when none joins near it. REQUIRES: the edge is on the map.
std::optional<Rerouted> rerouted(const Path& old, const Ways& ways, const EdgePosition& place, double near_m,
                                 double ahead_m, double behind_m);

}  // namespace railfix::track
