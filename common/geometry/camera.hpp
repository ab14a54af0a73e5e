// Pinhole camera over a track: pixels <-> rays <-> points on a plane parallel to the rail heads.
//
// Track axes at the camera's foot: X along the track, Y left, Z up; origin at the track centre on the rail heads.
// Camera axes: x right, y down, z along the optical axis. Pixel (0, 0) is the centre of the top left pixel.
#pragma once

#include <Eigen/Core>
#include <optional>

namespace railfix::geometry {

/// Pinhole with radial-tangential distortion (the EuRoC/OpenCV model with k1, k2, p1, p2).
struct Intrinsics {
  double fu_px = 0;
  double fv_px = 0;
  double cu_px = 0;
  double cv_px = 0;
  double k1 = 0;
  double k2 = 0;
  double p1 = 0;
  double p2 = 0;
  int width_px = 0;
  int height_px = 0;
};

/// Where the camera is and looks, against the track. All angles right-handed in track axes, applied yaw, pitch, roll:
/// R_track_from_camera_forward = Rz(yaw) * Ry(pitch) * Rx(roll). Pitch is positive down, yaw positive left.
struct CameraPose {
  double roll_rad = 0;
  double pitch_rad = 0;
  double yaw_rad = 0;
  double lateral_m = 0;  // camera left of the track centre
  double height_m = 0;   // camera above the rail heads
};

/// Normalised image coordinates (x/z, y/z) without distortion.
Eigen::Vector2d undistort(const Intrinsics& camera, const Eigen::Vector2d& pixel);
Eigen::Vector2d distort(const Intrinsics& camera, const Eigen::Vector2d& normalised);

/// Rotation that takes track axes to camera axes.
Eigen::Matrix3d rotation_camera_from_track(const CameraPose& pose);

/// One camera at one pose; cheap to make for every picture.
class View {
 public:
  View(const Intrinsics& camera, const CameraPose& pose);

  /// Pixel of a point in track axes (metres); nothing when it is less than 0.1 m in front of the camera.
  [[nodiscard]] std::optional<Eigen::Vector2d> project(const Eigen::Vector3d& point_track_m) const;
  /// Unit-less direction of a pixel's ray in track axes.
  [[nodiscard]] Eigen::Vector3d ray(const Eigen::Vector2d& pixel) const;
  /// Where the pixel's ray meets the plane Z = plane_z_m; nothing when it does not do so in front of the camera.
  [[nodiscard]] std::optional<Eigen::Vector2d> on_plane(const Eigen::Vector2d& pixel, double plane_z_m) const;
  /// Row of the horizon in the picture's middle column (distortion left out).
  [[nodiscard]] double horizon_v_px() const;

  [[nodiscard]] const Intrinsics& camera() const { return camera_; }
  [[nodiscard]] const CameraPose& pose() const { return pose_; }

 private:
  Intrinsics camera_;
  CameraPose pose_;
  Eigen::Matrix3d camera_from_track_;
  Eigen::Vector3d position_m_;
};

}  // namespace railfix::geometry
