#include "fusion/orientation.hpp"

#include <cmath>

namespace railfix::fusion {

void Orientation::add(const Eigen::Vector3d& rate_rps, const Eigen::Vector3d& force_mps2,
                      const ExpectedMotion& expected, double dt_s) {
  const auto& q = world_from_body_;
  const Eigen::Vector3d thought_up = q.conjugate() * Eigen::Vector3d::UnitZ();
  const double squared = expected.speed_mps * expected.speed_mps;
  // The curve pulls horizontally, which is not the leaning body's left.
  const Eigen::Vector3d left = (Eigen::Vector3d::UnitY() - thought_up.y() * thought_up).normalized();
  const Eigen::Vector3d of_motion = Eigen::Vector3d(expected.acceleration_mps2, 0, 0) +
                                    expected.curvature_per_m * squared * left +
                                    expected.vertical_curvature_per_m * squared * thought_up;
  const Eigen::Vector3d up = (force_mps2 - of_motion).normalized();
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
