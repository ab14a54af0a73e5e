// Between the camera and the line: rain, falling leaves, and the sun's glare in the lens.
#pragma once

#include <opencv2/core.hpp>

#include "geometry/camera.hpp"
#include "simulator/illumination.hpp"

namespace railfix::simulator {

/// A moment of the camera in the air. All of it moves with the train and with time, so that it does so from picture to
/// picture.
struct InTheAir {
  const geometry::Intrinsics& camera;
  const geometry::CameraPose& pose;
  double distance_m;
  double speed_mps;
  double exposure_s;
  double heading_rad;  // of the track at the foot
  uint64_t seed;
};

void draw_rain(const InTheAir& air, const Look& look, const Illumination& light, cv::Mat& radiance);
void draw_leaves(const InTheAir& air, const Look& look, const Illumination& light, cv::Mat& radiance);
/// Light that the sun spreads over a pixel inside the lens, 1 = a white sheet on a bright diffuse day.
class Glare {
 public:
  Glare(const InTheAir& air, const Illumination& light);
  [[nodiscard]] float at(double u_px, double v_px) const;
  void apply(cv::Mat& radiance) const;

 private:
  bool any_ = false;
  float sun_u_ = 0;
  float sun_v_ = 0;
  float strength_ = 0;
  float width_px_ = 0;
};

}  // namespace railfix::simulator
