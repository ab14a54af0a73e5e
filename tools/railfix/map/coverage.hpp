// Where on a way the confidence interval outgrows a limit, from how odometry drifts between references.
#pragma once

#include <memory>
#include <vector>

#include "core/result.hpp"
#include "track/path.hpp"

namespace railfix::tool {

struct CoverageOptions {
  double scale_sigma = 0.002;   // of odometry, 1 sigma, as a part of the way
  double sigmas = 4.5;          // the interval on either side, in sigmas
  double limit_m = 10;          // half the interval must not be longer
  double virtual_locacc_m = 5;  // Q_LOCACC of virtual groups that are proposed
  bool natural = false;         // frogs, portals, bridges, masts and platforms of the map count as references too
};

struct CoverageGap {
  double from_m = 0;  // distances on the path
  double to_m = 0;
  double largest_m = 0;              // half the interval at its end
  std::vector<double> references_m;  // places for virtual references that keep the limit, as few as can be
  bool outside_budget = false;       // beyond 5 m + 5 % of the way since the last reference (SUBSET-041)
};

struct Coverage {
  size_t references = 0;
  double covered_m = 0;
  double largest_m = 0;
  std::vector<CoverageGap> gaps;
};

/// Half the interval behind a reference of this location accuracy.
double half_interval_m(const CoverageOptions& options, double locacc_m, double way_m);

/// The straight way from a place, as long as asked for or to the end of the track; a length must be more than 0 m.
core::Result<track::Path> way_from(std::shared_ptr<const track::Map> map, const track::EdgePosition& start,
                                   double length_m);

/// The path is run from its begin (backwards: from its end), where the place is known as at a virtual reference. Gaps
/// come as the train meets them, in distances on the path; where references do not help within one, it stays one.
Coverage coverage_of(const track::Path& path, const CoverageOptions& options, bool backwards = false);

}  // namespace railfix::tool
