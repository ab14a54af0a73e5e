// How far the train moved between two pictures, from the ground between the rails; good to about a percent, which is
// enough to find a landmark again and to see how it shifts. Distances that are driven by are odometry's work.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "vision/ground_sheet.hpp"

namespace railfix::track_detector {

class GroundMotion {
 public:
  explicit GroundMotion(double max_speed_mps) : max_speed_mps_(max_speed_mps) {}

  /// Metres on the sheet since the previous picture; nothing before two steps in a row agree, and after a second
  /// without a match. A step that cannot be measured in between is the last one again.
  std::optional<double> step(const vision::TopView& view, const vision::Sheet& sheet, int64_t stamp_ns);
  void forget();

 private:
  struct Match {
    double metres = 0;
    double correlation = -1;
  };
  void take_profile(const vision::TopView& view, const vision::Sheet& sheet);
  [[nodiscard]] Match match(double from_m, double to_m, double cell_m) const;
  [[nodiscard]] double correlation(int shift) const;
  [[nodiscard]] Match match_anywhere(double dt_s, double cell_m) const;
  bool fits_better_elsewhere(const Match& found, double dt_s, double cell_m);

  double max_speed_mps_;
  int rows_ = 0;
  std::vector<float> now_, before_;  // strips x rows, without their slow changes
  std::vector<double> raw_, sums_;
  int64_t stamp_ns_ = 0;
  int64_t measured_ns_ = 0;
  std::optional<double> speed_mps_;
  bool locked_ = false;
  int64_t looked_elsewhere_ns_ = 0;
  int better_elsewhere_ = 0;  // looks in a row
};

}  // namespace railfix::track_detector
