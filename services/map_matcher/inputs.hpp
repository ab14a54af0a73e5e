// What may come in: numbers that are numbers, and such as a train can have. One that is none would stay in every sum.
#pragma once

#include "map_matcher/followed_path.hpp"
#include "map_matcher/match_types.hpp"
#include "map_matcher/step_chain.hpp"

namespace railfix::map_matcher {

/// What track_view says of rails that are seen.
struct ViewInput {
  double curvature_per_m = 0;
  double variance = 0;
  int64_t stamp_ns = 0;
};
/// What imu_sample says of the turning.
struct GyroInput {
  double rate_rps = 0;
  int64_t stamp_ns = 0;
};
/// What gnss_fix says, on the plane of the map.
struct GnssInput {
  double easting_m = 0;
  double northing_m = 0;
  double hdop = 0;
  int64_t stamp_ns = 0;
};
/// What train_state says.
struct StateInput {
  PlacedTrain placed;
  double sigma_m = 0;
  double track_probability = 0;
  double visual_scale = 1;
  track::PlanPose pose;     // of the cab, on the map that the place is of
  bool track_known = true;  // otherwise it is nowhere on the map
  bool usable = true;       // otherwise its place is no position
  bool standstill = false;
  bool gnss_agrees = false;
  bool camera_agrees = true;  // otherwise the way is not what it says, and its pictures may be old ones
};

[[nodiscard]] bool has_sense(const Sighting& sighting);
[[nodiscard]] bool has_sense(const Turn& turn);
/// One that was not measured says nothing that could be wrong.
[[nodiscard]] bool has_sense(const StepInput& step);
[[nodiscard]] bool has_sense(const ViewInput& view);
[[nodiscard]] bool has_sense(const GyroInput& gyro);
[[nodiscard]] bool has_sense(const GnssInput& gnss);
/// Of a place that is known. The speed may be unknown (NaN), and the interval without end.
[[nodiscard]] bool has_sense(const StateInput& state);

}  // namespace railfix::map_matcher
