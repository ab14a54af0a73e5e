// Where an opening stands (a portal's, a bridge's) and how wide it is, from how far apart both its sides show in the
// same pictures: what the pose and the followed curve are wrong by moves both sides alike and leaves that as it is.
#pragma once

#include <optional>

#include "track_detector/edge_tracker.hpp"

namespace railfix::track_detector {

struct Opening {
  double place_m = 0;  // on the scale of the way
  double width_m = 0;
  double width_sigma_m = 0;
  LookAt last;  // at both sides, and how far ahead it was then: better known than any place on the way
  double last_ahead_m = 0;
  double sigma_m = 0;  // of that, of the measurements alone
};

/// Nothing where too few pictures show both edges, or hardly nearer than at first, or not as one opening's sides would.
[[nodiscard]] std::optional<Opening> opening_between(const SettledEdge& left, const SettledEdge& right);

/// Weight of one of two walls, both together 1: that beside another track is seen from farther away, where an error of
/// its bearing counts by that much more.
[[nodiscard]] inline double near_share(double lateral_m, double other_m) {
  return other_m * other_m / (lateral_m * lateral_m + other_m * other_m);
}

}  // namespace railfix::track_detector
