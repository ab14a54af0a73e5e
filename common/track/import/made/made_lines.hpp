// The open lines and junctions of a made-up network, before stations are built on them.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "core/random.hpp"
#include "track/import/fit/tangent_polygon.hpp"
#include "track/import/tracks.hpp"

namespace railfix::track {

/// Where lines meet: a straight, with up to two lines leaving at either end.
struct MadeJunction {
  PlanPose middle;
  double length_m = 0;
  double elevation_m = 0;
  std::array<std::vector<size_t>, 2> lines;  // behind and ahead, the one that runs straight on first

  /// Leaving at the end behind (0) or ahead (1).
  [[nodiscard]] PlanPose leaving(size_t side) const;
};

/// What a line is like, by the country it runs through.
struct Terrain {
  double leg_m = 0;   // mean length of a tangent
  double wander = 0;  // sideways, as a part of the leg
  double least_radius_m = 0;
  double most_radius_m = 0;
  double grade = 0;
  double speed_mps = 0;
};

struct MadeLine {
  std::string name;
  std::array<size_t, 2> junctions{};  // indices
  std::array<size_t, 2> sides{};      // the side of the junction at which the line begins and ends
  Terrain terrain;
  ImportedTrack main;
  std::vector<StraightStretch> straights;  // of the main track, turnouts at its ends not counted
  ImportedTrack second;                    // no elements on a line of one track
  double second_from_m = 0;                // where it leaves and joins the main track
  double second_to_m = 0;
  [[nodiscard]] bool has_second() const { return !second.alignment.elements().empty(); }
};

struct MadeLines {
  std::vector<MadeJunction> junctions;
  std::vector<MadeLine> lines;
  [[nodiscard]] double length_m() const;
};

constexpr double kMadeTrackSpacingM = 4.2;

/// n x n junctions about `spacing_m` apart, nine tenths of the neighbours connected.
MadeLines make_lines(size_t n, double spacing_m, uint64_t seed);

/// Two arcs that lead a track sideways by `left_m` (or right, negative) onto its parallel.
std::vector<Element> sideways(double left_m, double radius_m);
/// How far that is along the track.
double sideways_length_m(double left_m, double radius_m);

}  // namespace railfix::track
