// A plain picture of two rails on rough ground, exact to a fraction of a pixel, for tests and benchmarks.
#pragma once

#include <cmath>
#include <opencv2/core.hpp>
#include <optional>

#include "core/random.hpp"
#include "geometry/camera.hpp"
#include "track_detector/rail_fit.hpp"

namespace railfix::track_detector::test {

inline const geometry::Intrinsics kCab{1150, 1150, 639.5, 511.5, 0, 0, 0, 0, 1280, 1024};
inline const geometry::CameraPose kMount{0, 0.1, 0, 0, 2.6};

struct Scene {
  TrackShape shape;
  double gauge_m = 1.435;
  double rail_grey = 170;  // of the rail heads
  double ground_grey = 90;
  double noise_grey = 6;
  bool left_rail = true;
  bool right_rail = true;
};

/// 0..1: how much of a strip of width `blur_m` about y lies on the band from `inner` to `inner` + head.
inline double covered(double y_m, double inner_m, double head_m, double blur_m) {
  const double low = std::max(y_m - blur_m / 2, inner_m);
  const double high = std::min(y_m + blur_m / 2, inner_m + head_m);
  return std::clamp((high - low) / blur_m, 0.0, 1.0);
}

/// Where a pixel sees the ground, which is hollow or humped as the track is; nothing above its horizon.
inline std::optional<Eigen::Vector2d> on_ground(const geometry::View& view, const TrackShape& shape,
                                                const Eigen::Vector2d& pixel) {
  const Eigen::Vector3d ray = view.ray(pixel);
  const double height_m = view.pose().height_m;
  const double depression = -ray.z() / ray.x();
  const double square = depression * depression + 2 * shape.vertical_curvature_per_m * height_m;
  if (ray.x() <= 0 || square <= 0 || depression + std::sqrt(square) <= 0) return std::nullopt;
  const double ahead_m = 2 * height_m / (depression + std::sqrt(square));
  return Eigen::Vector2d(ahead_m, view.pose().lateral_m + ahead_m * ray.y() / ray.x());
}

inline cv::Mat render(const Scene& scene, const geometry::Intrinsics& camera = kCab, uint64_t seed = 1) {
  constexpr double kHeadM = 0.07;
  const geometry::View view(camera, scene.shape.camera);
  core::Random random(seed);
  cv::Mat picture(camera.height_px, camera.width_px, CV_8UC1);
  for (int v = 0; v < picture.rows; ++v) {
    for (int u = 0; u < picture.cols; ++u) {
      const auto ground = on_ground(view, scene.shape, {u, v});
      double grey = 150;
      if (ground && ground->x() < 400) {
        const double x = ground->x();
        const double middle = rail_point(scene.shape, Side::left, 0, x).y();
        const double blur_m = std::max(1e-3, x / camera.fu_px);
        const double y = ground->y() - middle;
        double rail = 0;
        if (scene.left_rail) rail += covered(y, scene.gauge_m / 2, kHeadM, blur_m);
        if (scene.right_rail) rail += covered(-y, scene.gauge_m / 2, kHeadM, blur_m);
        grey = scene.ground_grey + (scene.rail_grey - scene.ground_grey) * rail;
      }
      picture.at<uint8_t>(v, u) = cv::saturate_cast<uint8_t>(grey + scene.noise_grey * random.normal());
    }
  }
  return picture;
}

}  // namespace railfix::track_detector::test
