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

/// A picture that was sent before says nothing of the present; above all it does not say that the train stands.
inline bool is_repeat(uint32_t picture_health) { return (picture_health & msg::PICTURE_FROZEN) != 0; }

/// How much less a picture of this health is to be trusted: a factor on the sigmas of what is measured in it.
inline double sigma_factor(uint32_t picture_health) {
  return (picture_health & (msg::PICTURE_COVERED | msg::PICTURE_BLURRED)) != 0 ? 3.0 : 1.0;
}

}  // namespace railfix::messaging
