// camera_calibration as the geometry that it means.
#pragma once

#include <algorithm>
#include <cmath>
#include <iterator>

#include "geometry/camera.hpp"
#include "idl/camera.h"

namespace railfix::messaging {

inline geometry::Intrinsics intrinsics_of(const msg::CameraCalibration& c) {
  return {c.fu_px(),
          c.fv_px(),
          c.cu_px(),
          c.cv_px(),
          c.k1(),
          c.k2(),
          c.p1(),
          c.p2(),
          static_cast<int>(c.width_px()),
          static_cast<int>(c.height_px())};
}

/// A guess where mount_known is false.
inline geometry::CameraPose mount_of(const msg::CameraCalibration& c) {
  return {c.roll_rad(), c.pitch_rad(), c.yaw_rad(), c.lateral_m(), c.height_m()};
}

/// Why no camera can be as this says, for a sentence; null when one can. Far outside of what cabs have, searches for
/// rails would take minutes.
inline const char* why_unusable(const msg::CameraCalibration& c) {
  constexpr double kSteepestRad = 1.5;
  const auto is_camera_of = [](double focal_px, uint32_t size_px) {
    return focal_px > 0.05 * size_px && focal_px < 50.0 * size_px;
  };
  const double numbers[] = {c.fu_px(), c.fv_px(),    c.cu_px(),     c.cv_px(),   c.k1(),        c.k2(),      c.p1(),
                            c.p2(),    c.roll_rad(), c.pitch_rad(), c.yaw_rad(), c.lateral_m(), c.height_m()};
  if (!std::all_of(std::begin(numbers), std::end(numbers), [](double one) { return std::isfinite(one); }))
    return "a value in it is not a number";
  if (c.width_px() < 64 || c.height_px() < 64) return "it has no size of pictures";
  if (!is_camera_of(c.fu_px(), c.width_px()) || !is_camera_of(c.fv_px(), c.height_px()))
    return "its focal length is missing or no camera's";
  if (std::abs(c.roll_rad()) > kSteepestRad || std::abs(c.pitch_rad()) > kSteepestRad ||
      std::abs(c.yaw_rad()) > kSteepestRad)
    return "the camera looks away from the track";
  if (!(c.height_m() > 0.3 && c.height_m() < 20) || std::abs(c.lateral_m()) > 20)
    return "its place above the rails is missing or no cab's";
  return nullptr;
}

/// Why a picture of this health says nothing of the present (above all not that the train stands); null when it does.
inline const char* why_useless(uint32_t picture_health) {
  if ((picture_health & msg::PICTURE_FROZEN) != 0) return "the camera sends the same picture again";
  if ((picture_health & msg::PICTURE_OUT_OF_ORDER) != 0) return "the pictures' time stamps do not grow";
  return nullptr;
}

/// How much less a picture of this health is to be trusted: a factor on the sigmas of what is measured in it.
inline double sigma_factor(uint32_t picture_health) {
  constexpr uint32_t kDoubtful =
      msg::PICTURE_DARK | msg::PICTURE_SATURATED | msg::PICTURE_COVERED | msg::PICTURE_BLURRED;
  return (picture_health & kDoubtful) != 0 ? 3.0 : 1.0;
}

}  // namespace railfix::messaging
