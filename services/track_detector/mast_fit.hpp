// Size and place of a mast from its two upright edges. The middle between its outlines is the middle of a mast of any
// symmetrical section (square, round, H), so no shape is assumed; what the picture cannot tell is in the sigma.
#pragma once

#include <algorithm>
#include <optional>

#include "track_detector/edge_tracker.hpp"

namespace railfix::track_detector {

struct MastSize {
  double front_m = 0;  // across the track
  double side_m = 0;   // along it
  double rms_m = 0;
  int looks = 0;
  [[nodiscard]] double largest_m() const { return std::max(front_m, side_m); }
};

/// Middle, on the scale of the way.
struct MastPlace {
  double place_m = 0;
  double lateral_m = 0;
  double sigma_m = 0;  // of place_m
};

/// Nothing where the edges were hardly seen together.
[[nodiscard]] std::optional<MastSize> size_between(const SettledEdge& inner, const SettledEdge& outer);
/// From where the brightness stepped back in near looks, away from the track or towards it.
[[nodiscard]] std::optional<MastSize> size_outward(const SettledEdge& edge);
[[nodiscard]] std::optional<MastSize> size_inward(const SettledEdge& edge);

/// outer: null if it could not be followed.
[[nodiscard]] MastPlace mast_place(const SettledEdge& inner, const SettledEdge* outer, const MastSize& size);

}  // namespace railfix::track_detector
