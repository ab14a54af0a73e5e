#include "geometry/camera.hpp"

#include <Eigen/Geometry>
#include <cmath>

namespace railfix::geometry {
namespace {

constexpr double kNearestDepthM = 0.1;
constexpr int kUndistortIterations = 20;

// Camera axes (x right, y down, z forward) from forward-left-up axes.
Eigen::Matrix3d camera_from_forward_left_up() {
  Eigen::Matrix3d r;
  r << 0, -1, 0,  //
      0, 0, -1,   //
      1, 0, 0;
  return r;
}

}  // namespace

Eigen::Vector2d distort(const Intrinsics& camera, const Eigen::Vector2d& normalised) {
  const double x = normalised.x();
  const double y = normalised.y();
  const double r2 = x * x + y * y;
  const double radial = 1.0 + camera.k1 * r2 + camera.k2 * r2 * r2;
  const double xd = x * radial + 2.0 * camera.p1 * x * y + camera.p2 * (r2 + 2.0 * x * x);
  const double yd = y * radial + camera.p1 * (r2 + 2.0 * y * y) + 2.0 * camera.p2 * x * y;
  return {camera.fu_px * xd + camera.cu_px, camera.fv_px * yd + camera.cv_px};
}

Eigen::Vector2d undistort(const Intrinsics& camera, const Eigen::Vector2d& pixel) {
  const Eigen::Vector2d distorted((pixel.x() - camera.cu_px) / camera.fu_px, (pixel.y() - camera.cv_px) / camera.fv_px);
  Eigen::Vector2d normalised = distorted;
  // Fixed-point iteration: contracts for every lens whose picture is not folded over itself.
  for (int i = 0; i < kUndistortIterations; ++i) {
    const double x = normalised.x();
    const double y = normalised.y();
    const double r2 = x * x + y * y;
    const double radial = 1.0 + camera.k1 * r2 + camera.k2 * r2 * r2;
    const Eigen::Vector2d tangential(2.0 * camera.p1 * x * y + camera.p2 * (r2 + 2.0 * x * x),
                                     camera.p1 * (r2 + 2.0 * y * y) + 2.0 * camera.p2 * x * y);
    const Eigen::Vector2d next = (distorted - tangential) / radial;
    const bool settled = (next - normalised).squaredNorm() < 1e-24;
    normalised = next;
    if (settled) break;
  }
  return normalised;
}

Eigen::Matrix3d rotation_camera_from_track(const CameraPose& pose) {
  const Eigen::Matrix3d track_from_forward = (Eigen::AngleAxisd(pose.yaw_rad, Eigen::Vector3d::UnitZ()) *
                                              Eigen::AngleAxisd(pose.pitch_rad, Eigen::Vector3d::UnitY()) *
                                              Eigen::AngleAxisd(pose.roll_rad, Eigen::Vector3d::UnitX()))
                                                 .toRotationMatrix();
  return camera_from_forward_left_up() * track_from_forward.transpose();
}

View::View(const Intrinsics& camera, const CameraPose& pose)
    : camera_(camera),
      pose_(pose),
      camera_from_track_(rotation_camera_from_track(pose)),
      position_m_(0.0, pose.lateral_m, pose.height_m) {}

std::optional<Eigen::Vector2d> View::project(const Eigen::Vector3d& point_track_m) const {
  const Eigen::Vector3d p = camera_from_track_ * (point_track_m - position_m_);
  if (p.z() < kNearestDepthM) return std::nullopt;
  return distort(camera_, p.head<2>() / p.z());
}

Eigen::Vector3d View::ray(const Eigen::Vector2d& pixel) const {
  const Eigen::Vector2d n = undistort(camera_, pixel);
  return camera_from_track_.transpose() * Eigen::Vector3d(n.x(), n.y(), 1.0);
}

std::optional<Eigen::Vector2d> View::on_plane(const Eigen::Vector2d& pixel, double plane_z_m) const {
  const Eigen::Vector3d direction = ray(pixel);
  const double drop = plane_z_m - position_m_.z();
  const double scale = drop / direction.z();
  if (!std::isfinite(scale) || scale < kNearestDepthM) return std::nullopt;
  return (position_m_ + scale * direction).head<2>();
}

double View::horizon_v_px() const {
  const Eigen::Vector3d up = camera_from_track_.col(2);
  if (std::abs(up.y()) < 1e-9) return camera_.cv_px;
  return camera_.cv_px - camera_.fv_px * up.z() / up.y();
}

}  // namespace railfix::geometry
