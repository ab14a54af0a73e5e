// Pictures of a random ground between two rails, rendered pixel by pixel from the exact geometry, for the tests' own
// truth.
#pragma once

#include <functional>
#include <opencv2/core.hpp>
#include <vector>

#include "core/random.hpp"
#include "geometry/camera.hpp"

namespace railfix::test {

geometry::Intrinsics small_camera();
geometry::CameraPose cab_mount();

class SyntheticGround {
 public:
  struct Options {
    double stone_contrast = 30;   // grey levels, 1 sigma
    double sleeper_contrast = 0;  // sleepers every 0.60 m, brighter by so much
    double sleeper_bow_m = 0;     // their middle shows farther on than their ends, as sagging ones do
    double texture_depth_m = 0.18;
    double curvature_per_m = 0;
    double vertical_curvature_per_m = 0;
  };
  SyntheticGround(uint64_t seed, const Options& options);

  struct Light {
    double gain = 1;
    double bias = 0;
    double noise = 2;
    std::function<double(double u_px, double v_px)> shade;      // factor on the brightness of a pixel
    std::function<double(double u_px, double v_px)> glare;      // added to it
    std::function<double(double along_m, double left_m)> cast;  // factor on the ground, ahead of the camera
  };
  /// The view when the camera's foot has gone `distance_m` along the track.
  cv::Mat picture(const geometry::Intrinsics& camera, const geometry::CameraPose& pose, double distance_m,
                  const Light& light);

 private:
  [[nodiscard]] float ground(double along_m, double left_m) const;
  void prepare(const geometry::Intrinsics& camera);
  Options options_;
  std::vector<Eigen::Vector3f> rays_;  // of every pixel, camera axes
  std::vector<float> noise_;
  cv::Mat stones_;  // 1 cm cells, repeats after its length
  core::Random random_;
};

}  // namespace railfix::test
