// How well a run knew where the train was: drift of the measured distance, error and interval of the position.
#pragma once

#include <cstdint>
#include <vector>

#include "evaluation/run_tables.hpp"
#include "evaluation/statistics.hpp"
#include "evaluation/truth.hpp"
#include "evaluation/turn.hpp"

namespace railfix::evaluation {

/// Distance and speed of one sample beside the truth; distances count from the first sample that has a truth.
struct MotionSample {
  int64_t stamp_ns = 0;
  double true_distance_m = 0;
  double distance_m = 0;
  double true_speed_mps = 0;
  double speed_mps = 0;
};

struct Drift {
  double travelled_m = kUnknown;  // in truth, forward and back
  double error_m = kUnknown;      // at the end, measured minus true
  double percent = kUnknown;      // |error| of the distance travelled
  Summary window_percent;         // the same over every stretch of 100 m, one beginning each 10 m
};
Drift drift_of(const std::vector<MotionSample>& samples);

struct OdometryResult {
  std::vector<MotionSample> samples;
  Drift drift;
  double valid_percent = kUnknown;
  double blind_percent = kUnknown;
  double speed_rms_mps = kUnknown;
  TurnResult turn;
};
OdometryResult judge_odometry(const Truth& truth, const std::vector<OdometryRow>& rows);

struct PositionSample {
  int64_t stamp_ns = 0;
  double true_distance_m = 0;
  double along_m = 0;         // estimate in front of the true place: positive
  double cross_m = kUnknown;  // estimate left of the true place: positive
  double over_m = kUnknown;
  double under_m = kUnknown;
  double easting_m = kUnknown;
  double northing_m = kUnknown;
  bool usable = true;          // integrity other than unusable
  bool track_declared = true;  // which of several tracks is known
  [[nodiscard]] bool has_interval() const;
  [[nodiscard]] bool covered() const;  // the true place lies in [estimate - over, estimate + under]
};

struct PositionResult {
  /// True: map coordinates against the truth's. False: distance run since the first state, because one of them has no
  /// coordinates, or the truth no heading.
  bool from_map = false;
  bool truth_lacks_heading = false;
  std::vector<PositionSample> samples;  // only those with a position
  size_t states = 0;
  size_t beside_truth = 0;  // of them, those whose time the truth holds
  std::vector<MotionSample> motion;
  Drift drift;      // of the state's distance_m
  Summary error_m;  // |along|
  double bias_m = kUnknown;
  Summary cross_m;                            // |cross|
  double coverage_percent = kUnknown;         // of the samples with an interval
  double coverage_usable_percent = kUnknown;  // ... whose integrity is not unusable
  double usable_percent = kUnknown;
  size_t without_interval = 0;
  Summary interval_width_m;  // over + under
  double speed_rms_mps = kUnknown;
  double known_percent = kUnknown;  // share of the states with a known track
  double known_after_s = kUnknown;  // since the first state
  double right_percent = kUnknown;  // of those, how many lie less than 2 m aside
};
PositionResult judge_position(const Truth& truth, const std::vector<StateRow>& rows);

}  // namespace railfix::evaluation
