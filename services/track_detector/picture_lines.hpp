// Brightness along straight lines in space, seen through the camera: the building block of views that are not square
// sheets of the ground.
#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <vector>

#include "geometry/camera.hpp"

namespace railfix::track_detector {

constexpr float kNotSeen = -1.0F;

class PictureLines {
 public:
  explicit PictureLines(const geometry::Intrinsics& camera) : camera_(camera) {}

  /// Grey levels at start + i * step (camera axes, any scale), i < count; kNotSeen outside the picture.
  /// REQUIRES: grey is CV_8UC1 of the camera's size.
  void sample(const cv::Mat& grey, const Eigen::Vector3f& start, const Eigen::Vector3f& step, int count, float* out);

  [[nodiscard]] const geometry::Intrinsics& camera() const { return camera_; }

 private:
  geometry::Intrinsics camera_;
  std::vector<float> u_px_, v_px_;
};

}  // namespace railfix::track_detector
