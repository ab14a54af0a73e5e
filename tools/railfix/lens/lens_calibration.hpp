// Focal lengths, principal point and distortion from pictures of a board: Zhang's method (MSR-TR-98-71) as OpenCV does
// it, with the uncertainties of the least squares fit.
#pragma once

#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "core/result.hpp"
#include "geometry/camera.hpp"
#include "lens/board.hpp"

namespace railfix::tool {

struct LensCalibration {
  geometry::Intrinsics lens;
  geometry::Intrinsics sigma;  // one sigma of each number; the size is not set
  double rms_px = 0;           // reprojection, over both coordinates
  double coverage = 0;         // share of the picture's 8 x 6 fields with a corner
  double tilt_rad = 0;         // largest angle between two boards
  struct View {
    BoardView board;
    std::vector<cv::Point2f> reprojected;
    double rms_px = 0;
  };
  std::vector<View> views;            // that were used
  std::vector<std::string> alike;     // left out: nearly the same as one before
  std::vector<std::string> outliers;  // left out: do not agree with the others
};

/// What is wanted of the pictures. The error says what kind of pictures is missing.
core::Result<LensCalibration> calibrate_lens(const std::vector<BoardView>& views, const cv::Size& size);

/// Share of the picture's fields with a corner.
double coverage(const std::vector<BoardView>& views, const cv::Size& size);

}  // namespace railfix::tool
