// Where on a way the promised interval would outgrow a limit, and what would help: a nominal ride with what the camera
// can sight there.
#pragma once

#include <map>
#include <memory>
#include <vector>

#include "core/result.hpp"
#include "fusion/fusion_parameters.hpp"
#include "map/nominal_ride.hpp"
#include "track/path.hpp"

namespace railfix::tool {

struct CoverageOptions {
  fusion::FusionParameters fusion;
  std::vector<track::LandmarkKind> sighted;  // only these; empty = all that can be
  double speed_mps = 80 / 3.6;
  double limit_m = 10;          // half the interval must not be longer
  double marker_sigma_m = 0.1;  // of the place of a marker that is proposed, on the map
  double group_limit_m = 2500;  // balise groups, real or virtual, must not be further apart
};

/// Is a landmark of this kind a reference?
bool counts(track::LandmarkKind kind, const CoverageOptions& options);

/// What of a way's map tells fusion where the train is, and what does not.
struct References {
  std::map<track::LandmarkKind, size_t> counted;
  size_t virtual_groups = 0;
  size_t unsighted_groups = 0;  // real ones of which no balise is among the landmarks that count
};

struct CoverageGap {
  double from_m = 0;  // distances on the path
  double to_m = 0;
  double largest_m = 0;         // half the interval
  bool outside_budget = false;  // somewhere more than 5 m + 5 % of the way since the last sure reference (SUBSET-041)
};

struct Extent {
  double covered_m = 0;
  double largest_m = 0;
  std::vector<CoverageGap> gaps{};  // as the train meets them
};

/// There and back: both stand at the path's places.
struct BothWays {
  Extent there;
  Extent back;
};

struct Coverage {
  BothWays now;
  std::vector<double> markers_m;  // places on the path for what would help
  BothWays with_markers;
};

/// The straight way from a place, as long as asked for or to the end of the track; a length must be more than 0 m, and
/// the track must not end at once.
core::Result<track::Path> way_from(std::shared_ptr<const track::Map> map, const track::EdgePosition& start,
                                   double length_m);

References references_on(const track::Path& path, const CoverageOptions& options);

/// What a train is promised on the way, in metres run: as in a nominal ride, and a little more, because in real ones
/// sensors err by something.
std::vector<PromisedPlace> promised_on(const track::Path& path, const CoverageOptions& options, bool backwards = false);

/// The path is run from its begin, and back from its end, where fusion is told to be. Markers are proposed where they
/// make the interval hold the limit on more of the way; each serves trains of both directions.
Coverage coverage_of(const track::Path& path, const CoverageOptions& options);

}  // namespace railfix::tool
