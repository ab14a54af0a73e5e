// Does the pose keep away from the calibrated mount? Shake averages out, a camera that was knocked does not.
#pragma once

#include <string>

#include "track_detector/rail_fit.hpp"

namespace railfix::track_detector {

class MountWatch {
 public:
  MountWatch(const TrackShape& mount, const TrackShapeSigma& limits);
  /// A pose from a picture with both rails seen, `interval_s` after the previous one. Those in curves do not count.
  void add(const TrackShape& shape, double curvature_sigma_per_m, double interval_s);
  /// The average of the last minute is off by more than shake and suspension explain.
  [[nodiscard]] bool drifted() const { return !what_drifted().empty(); }
  /// "pitch by +0.52 deg (0.37 may be)"; empty when nothing has.
  [[nodiscard]] std::string what_drifted() const;

 private:
  Eigen::Matrix<double, 5, 1> mount_;
  Eigen::Matrix<double, 5, 1> sigma_;
  Eigen::Matrix<double, 5, 1> average_ = Eigen::Matrix<double, 5, 1>::Zero();  // of the deviation
  double curvature_per_m_ = 0;                                                 // average of what passed for straight
  double seen_s_ = 0;
};

}  // namespace railfix::track_detector
