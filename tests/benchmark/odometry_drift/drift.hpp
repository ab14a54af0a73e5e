// Distance measured against distance travelled: the whole run, windows of 100 m, standstill, honesty of the sigmas,
// time.
#pragma once

#include <vector>

#include "dataset/dataset.hpp"
#include "odometry/train_mouse.hpp"

namespace railfix {

class Drift {
 public:
  explicit Drift(bool print_windows) : print_windows_(print_windows) {}
  void add(const dataset::TruthRow& truth, const odometry::MouseStep& step, double seconds);
  void print() const;

 private:
  void compare(double true_step_m, const odometry::MouseStep& step);
  void close_window(const dataset::TruthRow& truth, const odometry::MouseStep& step);

  bool print_windows_;
  bool begun_ = false;
  double first_error_m_ = 0, mark_error_m_ = 0, mark_m_ = 0;
  double last_truth_m_ = 0, last_m_ = 0;
  double travelled_m_ = 0, squared_m2_ = 0;
  double still_since_truth_m_ = 0;  // true distance when the measured one last moved
  size_t pictures_ = 0, valid_ = 0, steps_ = 0;
  size_t at_rest_ = 0, moved_at_rest_ = 0, false_rest_ = 0;
  int64_t rest_begin_ns_ = 0;  // 0 = the train moves
  double rest_moved_m_ = 0;
  double longest_false_rest_m_ = 0;
  std::vector<double> window_percent_, seconds_;
  std::vector<double> normalised_, normalised_short_;      // error of a step over its sigma, of all and of short steps
  std::vector<std::pair<int64_t, double>> true_distance_;  // of the last second, to find references in
};

}  // namespace railfix
