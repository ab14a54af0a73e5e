// Is this picture good enough to measure in? Looks at a coarse grid of pixels, a few microseconds a picture.
#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <optional>

namespace railfix::frame_grabber {

/// The bits have the values of PICTURE_* in idl/camera.idl.
enum HealthBit : uint32_t { kDark = 1, kSaturated = 2, kFrozen = 4, kOutOfOrder = 8 };

struct PictureHealthConfig {
  double dark_below_grey = 16;        // 95 % of the pixels are darker
  double saturated_share = 0.4;       // of the pixels are 250 or brighter
  int64_t frozen_after_pictures = 5;  // so many pictures in a row are equal to the last bit: no camera is free of noise
};

class PictureHealth {
 public:
  explicit PictureHealth(const PictureHealthConfig& config) : config_(config) {}
  /// Bits of HealthBit, 0 = good. REQUIRES: CV_8UC1, not empty. Keeps a reference to the picture until the next call.
  uint32_t judge(int64_t stamp_ns, const cv::Mat& grey);

 private:
  PictureHealthConfig config_;
  cv::Mat last_;
  std::optional<int64_t> newest_ns_;
  int64_t equal_pictures_ = 0;
};

}  // namespace railfix::frame_grabber
