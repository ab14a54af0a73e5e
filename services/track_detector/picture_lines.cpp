#include "track_detector/picture_lines.hpp"

#include "vision/picture_line.hpp"

namespace railfix::track_detector {

void PictureLines::sample(const cv::Mat& grey, const Eigen::Vector3f& start, const Eigen::Vector3f& step, int count,
                          float* out) {
  u_px_.resize(static_cast<size_t>(count));
  v_px_.resize(static_cast<size_t>(count));
  float* u = u_px_.data();
  float* v = v_px_.data();
  vision::project_line(camera_, start, step, count, u, v);
  const auto right = static_cast<float>(camera_.width_px - 2);
  const auto bottom = static_cast<float>(camera_.height_px - 2);
  for (int i = 0; i < count; ++i) {
    const bool seen = u[i] >= 0 && v[i] >= 0 && u[i] < right && v[i] < bottom;
    out[i] = seen ? vision::bilinear(grey, u[i], v[i]) : kNotSeen;
  }
}

}  // namespace railfix::track_detector
