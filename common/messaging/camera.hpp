// camera_calibration as the geometry that it means.
#pragma once

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
