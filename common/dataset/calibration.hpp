// A camera's calibration file: sensor.yaml of a dataset, camera.yaml of `railfix calibrate` (one format for both).
#pragma once

#include <filesystem>
#include <optional>

#include "core/result.hpp"
#include "geometry/camera.hpp"

namespace railfix::dataset {

struct CameraCalibration {
  geometry::Intrinsics intrinsics;
  double rate_hz = 0;                         // 0 = not known
  std::optional<geometry::CameraPose> mount;  // nothing = run `railfix calibrate mount`
  // One sigma of each number; nothing = not known. A roll that was held at 0 has none (0).
  std::optional<geometry::Intrinsics> intrinsics_sigma{};
  std::optional<geometry::CameraPose> mount_sigma{};
};

/// rate_hz, resolution, camera_model: pinhole, intrinsics, distortion_model: radial-tangential (or none),
/// distortion_coefficients, optional mount {height_m, pitch_rad, yaw_rad, roll_rad, lateral_m}, and optional
/// intrinsics_sigma, distortion_sigma and mount_sigma of the same shapes. Other keys are ignored (EuRoC files carry
/// more).
core::Result<CameraCalibration> read_calibration(const std::filesystem::path& file);
/// On an error the file that was there is as it was.
core::Status write_calibration(const std::filesystem::path& file, const CameraCalibration& calibration);

/// The calibration that lies with the pictures: mav0/cam0/sensor.yaml, camera.yaml or KITTI's calib.txt (which has no
/// picture size: width_px = height_px = 0). Nothing when there is none.
core::Result<std::optional<CameraCalibration>> find_calibration(const std::filesystem::path& pictures);

}  // namespace railfix::dataset
