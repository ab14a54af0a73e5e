#include "fusion/orientation.hpp"

#include <cmath>

namespace railfix::fusion {

void Orientation::add(const Eigen::Vector3d& rate_rps, const Eigen::Vector3d& force_mps2,
                      const ExpectedMotion& expected, double dt_s) {
  const double squared = expected.speed_mps * expected.speed_mps;
  const Eigen::Vector3d of_motion(expected.acceleration_mps2, expected.curvature_per_m * squared,
                                  expected.vertical_curvature_per_m * squared);
  const Eigen::Vector3d up = (force_mps2 - of_motion).normalized();
  const auto& q = world_from_body_;
  const Eigen::Vector3d thought_up = q.conjugate() * Eigen::Vector3d::UnitZ();
  // Madgwick's f and its Jacobian (25, 26), for a Z axis that is up.
  const Eigen::Vector3d f = thought_up - up;
  Eigen::Matrix<double, 3, 4> j;                      // by w, x, y, z
  j << -2 * q.y(), 2 * q.z(), -2 * q.w(), 2 * q.x(),  //
      2 * q.x(), 2 * q.w(), 2 * q.z(), 2 * q.y(),     //
      0, -4 * q.x(), -4 * q.y(), 0;
  Eigen::Vector4d down = j.transpose() * f;
  // The unit step of the original rattles about its goal; near it the step shrinks with the misfit.
  const double size = down.norm();
  if (size > 0) down *= std::min(1.0, size / 0.2) / size;
  const Eigen::Quaterniond turn = q * Eigen::Quaterniond(0, 0.5 * rate_rps.x(), 0.5 * rate_rps.y(), 0.5 * rate_rps.z());
  const Eigen::Vector4d rate = Eigen::Vector4d(turn.w(), turn.x(), turn.y(), turn.z()) - gain_rps_ * down;
  const Eigen::Vector4d next = Eigen::Vector4d(q.w(), q.x(), q.y(), q.z()) + dt_s * rate;
  world_from_body_ = Eigen::Quaterniond(next(0), next(1), next(2), next(3)).normalized();
}

double Orientation::roll_rad() const {
  const Eigen::Vector3d up = world_from_body_.conjugate() * Eigen::Vector3d::UnitZ();
  return std::atan2(up.y(), up.z());
}

double Orientation::pitch_rad() const {
  const Eigen::Vector3d up = world_from_body_.conjugate() * Eigen::Vector3d::UnitZ();
  return std::atan2(-up.x(), std::hypot(up.y(), up.z()));
}

}  // namespace railfix::fusion
