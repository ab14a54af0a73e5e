#include "track_detector/picture_lines.hpp"

namespace railfix::track_detector {
namespace {

constexpr float kNearest = 0.05F;  // of the camera; nearer or behind is not seen

float bilinear(const cv::Mat& grey, float u, float v) {
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

}  // namespace

void PictureLines::sample(const cv::Mat& grey, const Eigen::Vector3f& start, const Eigen::Vector3f& step, int count,
                          float* out) {
  u_px_.resize(static_cast<size_t>(count));
  v_px_.resize(static_cast<size_t>(count));
  const auto fu = static_cast<float>(camera_.fu_px);
  const auto fv = static_cast<float>(camera_.fv_px);
  const auto cu = static_cast<float>(camera_.cu_px);
  const auto cv = static_cast<float>(camera_.cv_px);
  const auto k1 = static_cast<float>(camera_.k1);
  const auto k2 = static_cast<float>(camera_.k2);
  const auto p1 = static_cast<float>(camera_.p1);
  const auto p2 = static_cast<float>(camera_.p2);
  float* u = u_px_.data();
  float* v = v_px_.data();
  for (int i = 0; i < count; ++i) {  // no branches: vectorised by the compiler
    const auto c = static_cast<float>(i);
    const float depth = start.z() + c * step.z();
    const float inverse = 1.0F / depth;
    const float x = (start.x() + c * step.x()) * inverse;
    const float y = (start.y() + c * step.y()) * inverse;
    const float r2 = x * x + y * y;
    const float radial = 1.0F + r2 * (k1 + k2 * r2);
    u[i] = depth > kNearest ? fu * (x * radial + 2.0F * p1 * x * y + p2 * (r2 + 2.0F * x * x)) + cu : -1.0F;
    v[i] = fv * (y * radial + p1 * (r2 + 2.0F * y * y) + 2.0F * p2 * x * y) + cv;
  }
  const auto right = static_cast<float>(camera_.width_px - 2);
  const auto bottom = static_cast<float>(camera_.height_px - 2);
  for (int i = 0; i < count; ++i) {
    const bool seen = u[i] >= 0 && v[i] >= 0 && u[i] < right && v[i] < bottom;
    out[i] = seen ? bilinear(grey, u[i], v[i]) : kNotSeen;
  }
}

}  // namespace railfix::track_detector
