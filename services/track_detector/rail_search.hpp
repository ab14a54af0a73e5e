// Finds both rails in a single picture: every shake and curvature within the limits is tried on the ridge scores of the
// top view, both rails together at the gauge. No start from a previous picture is needed.
#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "track_detector/rail_fit.hpp"
#include "track_detector/top_view.hpp"

namespace railfix::track_detector {

/// Half widths of what is tried about the top view's pose.
struct SearchLimits {
  double pitch_rad = 0.02;
  double yaw_rad = 0.03;
  double lateral_m = 0.3;         // with roll: where between the rails the camera is
  double height_fraction = 0.05;  // of the height
  double curvature_per_m = 1.0 / 180;
};

struct RailCandidate {
  TrackShape shape;
  double score = 0;  // 0..1: how clear and how complete both rails are
  double left_score = 0;
  double right_score = 0;
};

/// One way the rails may lie in the top view. In the level frame of the view's pose a ray is (1, a, -b); a straight
/// rail is a = slope * b with slope = (y - lateral) / height; pitch and yaw errors shift b and a; curvature bends a by
/// beta * height / (2 b).
struct RailHypothesis {
  double pitch_rad = 0;
  double yaw_rad = 0;
  double curvature_per_m = 0;
  double left_slope = 0;
  double right_slope = 0;
  double score = 0;
  double left_score = 0;
  double right_score = 0;
};

/// Made once for a top view; keeps its buffers between pictures.
class RailSearch {
 public:
  /// REQUIRES: `view` lives as long as this. `head_m`: width of the rail head.
  RailSearch(const TopView& view, const SearchLimits& limits, double gauge_m, double head_m);

  /// The best candidates, best first, well apart from each other; may be empty. `ridges`: TopView's scores.
  /// Where limits are so wide that all curvatures would take too long, they take turns, evenly over the whole range:
  /// `turn` counts the pictures.
  const std::vector<RailCandidate>& find(const cv::Mat& ridges, size_t max_candidates, int turn = 0);
  /// Pictures that it takes to try all.
  [[nodiscard]] int turns() const { return turns_; }

 private:
  /// Slopes that one rail may have: first, first + step, ...
  struct SlopeGrid {
    double first = 0;
    double step = 0;
    int count = 0;
    [[nodiscard]] double at(int i) const { return first + i * step; }
  };
  /// Scores of one rail on a grid of slopes, under one pitch: there every yaw and curvature is a pure shift of a row.
  struct ShiftableRows {
    std::vector<float> cells;
    std::vector<float> sums;
  };

  [[nodiscard]] SlopeGrid slope_grid(double half_gauge_m) const;
  void resample(const SlopeGrid& grid, double pitch_rad, ShiftableRows& rows) const;
  void sum(const SlopeGrid& grid, ShiftableRows& rows) const;
  void spread(const cv::Mat& ridges);
  void coarse(int turn);
  void try_coarse(const RailHypothesis& h);
  [[nodiscard]] RailHypothesis refined(RailHypothesis h, const cv::Mat& ridges) const;
  bool try_move(RailHypothesis& h, const double (&move)[5], double sign, const cv::Mat& ridges) const;
  void evaluate(RailHypothesis& h, const cv::Mat& ridges) const;
  [[nodiscard]] double handicap(const RailHypothesis& h) const;
  [[nodiscard]] double lateral_handicap(double left_slope, double right_slope) const;
  [[nodiscard]] RailCandidate to_candidate(const RailHypothesis& h) const;
  [[nodiscard]] bool alike(const RailHypothesis& a, const RailHypothesis& b) const;

  const TopView& view_;
  SearchLimits limits_;
  double width_m_;  // between the middles of the heads
  SlopeGrid left_grid_;
  SlopeGrid right_grid_;
  int slack_ = 1;           // in grid steps: how far the width may be from the gauge
  int row_count_ = 0;       // of the coarse search
  int farthest_shift_ = 0;  // in grid steps
  std::vector<double> pitches_;
  std::vector<double> yaws_;
  std::vector<double> curvatures_;
  int turns_ = 1;
  std::vector<float> lateral_handicap_;  // by the sum of both rails' indices
  cv::Mat spread_;
  ShiftableRows left_;
  ShiftableRows right_;
  std::vector<double> shift_per_yaw_;  // of every coarse row, in grid steps
  std::vector<double> shift_per_curvature_;
  std::vector<int> shifts_;  // of every coarse row, from -farthest_shift_
  std::vector<RailHypothesis> found_;
  std::vector<RailHypothesis> kept_;
  double best_ = 0;
  std::vector<RailCandidate> candidates_;
};

}  // namespace railfix::track_detector
