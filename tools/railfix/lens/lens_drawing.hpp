// A picture of a lens calibration, to check by eye.
#pragma once

#include <opencv2/core.hpp>

#include "lens/lens_calibration.hpp"

namespace railfix::tool {

/// Left: one picture without its distortion; the board's edges must be straight. Right: every corner of every picture
/// with its residual, 100 times as long; arrows must point anywhere, and the whole field must be covered.
cv::Mat draw_lens(const LensCalibration& found, const cv::Mat& grey, const BoardView& view);

}  // namespace railfix::tool
