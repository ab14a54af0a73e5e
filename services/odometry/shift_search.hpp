// Coarse search: by how many rows has the ground moved in the top view? (paper 002, eq. 1, with gain and bias removed)
//
// Every row loses its mean over a few columns first, every column its mean. What changes slowly across the track
// (sleepers, cross shadows) or not at all along it (rail shadows, wheel marks) is gone then, so sleepers cannot vote
// for a shift by their own distance.
#pragma once

#include <cstdint>
#include <vector>

#include "vision/ground_sheet.hpp"

namespace railfix::odometry {

/// Top view at half resolution with unit local contrast, in 16-bit numbers: the processor multiplies eight at a time.
struct CoarseView {
  static constexpr int kMostSide = 2;  // empty columns on either side, so that shifts across need no limits
  int rows = 0;
  int cols = 0;
  int stride = 0;
  std::vector<int16_t> texture;
  std::vector<int64_t> energy;  // sum of squares of every row
  std::vector<uint8_t> row_seen;
  double contrast_grey = 0;  // root mean square of the texture before it was normalised, grey levels

  [[nodiscard]] const int16_t* row(int r) const { return &texture[static_cast<size_t>(r * stride + kMostSide)]; }
};

/// Keeps its buffers between pictures.
class CoarseViewMaker {
 public:
  void make(const vision::TopView& view, CoarseView& out);

 private:
  void halve(const vision::TopView& view, CoarseView& out);
  void remove_local_mean(float* line, int cols);
  void remove_means(const CoarseView& shape);
  void normalise(CoarseView& out);
  std::vector<float> half_;
  std::vector<float> column_;
  std::vector<float> sums_;     // of a row, prefix sums
  std::vector<double> energy_;  // of the rows before, prefix sums
  std::vector<int> seen_;       // rows before, prefix sums
};

struct RowRange {
  int first = 0;
  int last = 0;  // inclusive
};

struct ShiftPeak {
  double rows = 0;        // coarse rows; positive: ground came nearer, the train went forward
  int cols = 0;           // coarse columns that the ground went to the right
  double score = -1;      // normalised correlation, -1..1; -1 = no overlap
  double runner_up = -1;  // best score further than `apart` rows from the peak
};

/// What the new view shows beside the reference's ground when that has moved by `shift` rows (as ShiftPeak::rows):
/// noise, and whatever moves otherwise.
void take_out(const CoarseView& reference, const CoarseView& now, int shift, CoarseView& left_over);

/// Keeps its buffers between pictures.
class ShiftSearch {
 public:
  /// Best shift of `section` of the reference in the new view among `shifts`, with up to `side` columns to either side
  /// (at most CoarseView::kMostSide).
  ShiftPeak find(const CoarseView& reference, const CoarseView& now, RowRange section, RowRange shifts, int side,
                 int apart);

 private:
  std::vector<double> best_;  // per shift
};

}  // namespace railfix::odometry
