// Coarse search: by how many rows has the ground moved in the top view? (paper 002, eq. 1, with gain and bias removed)
//
// Every row and column loses its mean first. What is the same across the track (sleepers, cross shadows) or along it
// (rail shadows, wheel marks) is gone then, so sleepers cannot vote for a shift by their own distance.
#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "vision/ground_sheet.hpp"

namespace railfix::odometry {

/// Top view at half resolution with unit local contrast.
struct CoarseView {
  cv::Mat texture;  // CV_32F
  std::vector<uint8_t> row_seen;
  double contrast_grey = 0;  // root mean square of the texture before it was normalised, grey levels
};

CoarseView make_coarse(const vision::TopView& view);

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

/// Best shift of `section` of the reference in the new view among `shifts`, with up to `side` columns to either side.
ShiftPeak find_shift(const CoarseView& reference, const CoarseView& now, RowRange section, RowRange shifts, int side,
                     int apart);

}  // namespace railfix::odometry
