#include "vision/picture_line.hpp"

namespace railfix::vision {
namespace {

constexpr float kNearest = 0.05F;  // of the camera; nearer or behind is not seen

}  // namespace

void project_line(const geometry::Intrinsics& camera, const Eigen::Vector3f& start, const Eigen::Vector3f& step,
                  int count, float* u_px, float* v_px) {
  const auto fu = static_cast<float>(camera.fu_px);
  const auto fv = static_cast<float>(camera.fv_px);
  const auto cu = static_cast<float>(camera.cu_px);
  const auto cv = static_cast<float>(camera.cv_px);
  const auto k1 = static_cast<float>(camera.k1);
  const auto k2 = static_cast<float>(camera.k2);
  const auto p1 = static_cast<float>(camera.p1);
  const auto p2 = static_cast<float>(camera.p2);
  for (int i = 0; i < count; ++i) {  // no branches: vectorised by the compiler
    const auto c = static_cast<float>(i);
    const float depth = start.z() + c * step.z();
    const float inverse = 1.0F / depth;
    const float x = (start.x() + c * step.x()) * inverse;
    const float y = (start.y() + c * step.y()) * inverse;
    const float r2 = x * x + y * y;
    const float radial = 1.0F + r2 * (k1 + k2 * r2);
    u_px[i] = depth > kNearest ? fu * (x * radial + 2.0F * p1 * x * y + p2 * (r2 + 2.0F * x * x)) + cu : -1.0F;
    v_px[i] = fv * (y * radial + p1 * (r2 + 2.0F * y * y) + 2.0F * p2 * x * y) + cv;
  }
}

}  // namespace railfix::vision
