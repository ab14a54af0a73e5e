// Where a straight row of points in space shows in the picture, and how bright the picture is there: the innermost loop
// of every view that is computed from a picture.
#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>

#include "geometry/camera.hpp"

namespace railfix::vision {

/// Pixels of the points start + i * step (camera axes, any scale), i < count, through the lens. u is -1 for points that
/// are nearer than 0.05 or behind the camera.
void project_line(const geometry::Intrinsics& camera, const Eigen::Vector3f& start, const Eigen::Vector3f& step,
                  int count, float* u_px, float* v_px);

/// Grey level between four pixels. REQUIRES: grey is CV_8UC1, 0 <= u < width - 1, 0 <= v < height - 1.
inline float bilinear(const cv::Mat& grey, float u, float v) {
  const int x = static_cast<int>(u);
  const int y = static_cast<int>(v);
  const float fx = u - static_cast<float>(x);
  const float fy = v - static_cast<float>(y);
  const uchar* top = grey.ptr<uchar>(y) + x;
  const uchar* bottom = top + grey.step;
  const float a = static_cast<float>(top[0]) + fx * static_cast<float>(top[1] - top[0]);
  const float b = static_cast<float>(bottom[0]) + fx * static_cast<float>(bottom[1] - bottom[0]);
  return a + fy * (b - a);
}

}  // namespace railfix::vision
