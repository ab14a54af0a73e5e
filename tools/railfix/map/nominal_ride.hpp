// A train whose sensors err by nothing runs a way through the algorithms of map_matcher and fusion: so wide do they
// promise its place there, by their own parameters and rules.
#pragma once

#include <vector>

#include "fusion/fusion_parameters.hpp"
#include "track/map.hpp"

namespace railfix::tool {

/// One track alone, from its begin to its end.
struct RideWay {
  static constexpr double kSampledEveryM = 5;
  double length_m = 0;
  std::vector<double> curvature_per_m{};  // left positive, every so many metres and beyond the end
  std::vector<track::GradePoint> profile{};
  std::vector<track::Landmark> landmarks{};  // sighted, each of them; offset = place on the way, in that order
};

struct PromisedPlace {
  double at_m = 0;
  double half_m = 0;            // the longer side of the interval
  bool outside_budget = false;  // it is longer than SUBSET-041 allows behind the last sure reference
};

/// Camera, wheel and IMU without GNSS, from the begin, where fusion is told to start; as if all landmarks were sighted
/// sharply, or all of them vaguely, whichever is wider.
/// REQUIRES: a length and speed of more than 0.
std::vector<PromisedPlace> nominal_ride(const RideWay& way, const fusion::FusionParameters& parameters,
                                        double speed_mps);

}  // namespace railfix::tool
