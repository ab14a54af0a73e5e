#include "unit/odometry/synthetic_ground.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace railfix::test {
namespace {

constexpr double kCellM = 0.01;
constexpr int kLength = 12007;  // cells; no multiple of the sleeper distance
constexpr int kWidth = 256;

}  // namespace

geometry::Intrinsics small_camera() {
  geometry::Intrinsics camera;
  camera.fu_px = camera.fv_px = 750;
  camera.cu_px = 320;
  camera.cv_px = 240;
  camera.k1 = -0.12;
  camera.k2 = 0.03;
  camera.width_px = 640;
  camera.height_px = 512;
  return camera;
}

geometry::CameraPose cab_mount() {
  geometry::CameraPose pose;
  pose.pitch_rad = 0.21;
  pose.height_m = 2.6;
  return pose;
}

SyntheticGround::SyntheticGround(uint64_t seed, const Options& options) : options_(options), random_(seed) {
  cv::Mat fine(kLength, kWidth, CV_32F);
  for (int r = 0; r < fine.rows; ++r) {
    for (int c = 0; c < fine.cols; ++c) fine.at<float>(r, c) = static_cast<float>(random_.normal());
  }
  // Stones of 3 to 6 cm: two sizes of smoothed noise, each of unit contrast.
  stones_ = cv::Mat::zeros(fine.size(), CV_32F);
  for (const double sigma : {1.5, 3.0}) {
    cv::Mat smooth;
    cv::GaussianBlur(fine, smooth, cv::Size(0, 0), sigma);
    stones_ += smooth * (sigma * 2.0 * std::sqrt(3.14159) * 0.7);
  }
}

float SyntheticGround::ground(double along_m, double left_m) const {
  const double row = along_m / kCellM;
  const double col = std::clamp(left_m / kCellM + 0.5 * kWidth, 0.0, kWidth - 2.0);
  const auto r = static_cast<int64_t>(std::floor(row));
  const auto c = static_cast<int>(col);
  const auto fr = static_cast<float>(row - static_cast<double>(r));
  const auto fc = static_cast<float>(col - c);
  const auto wrapped = [](int64_t i) { return static_cast<int>(((i % kLength) + kLength) % kLength); };
  const auto* a = stones_.ptr<float>(wrapped(r)) + c;
  const auto* b = stones_.ptr<float>(wrapped(r + 1)) + c;
  const float top = a[0] + fc * (a[1] - a[0]);
  const float bottom = b[0] + fc * (b[1] - b[0]);
  auto grey = static_cast<float>(100.0 + options_.stone_contrast * (top + fr * (bottom - top)));
  const double straight_m = along_m - options_.sleeper_bow_m * std::cos(2.2 * left_m);
  const double in_period = straight_m / 0.6 - std::floor(straight_m / 0.6);
  if (in_period < 0.42) grey += static_cast<float>(options_.sleeper_contrast);
  return grey;
}

cv::Mat SyntheticGround::picture(const geometry::Intrinsics& camera, const geometry::CameraPose& pose,
                                 double distance_m, const Light& light) {
  if (rays_.size() != static_cast<size_t>(camera.width_px * camera.height_px)) prepare(camera);
  const Eigen::Matrix3f track_from_camera = geometry::rotation_camera_from_track(pose).transpose().cast<float>();
  const auto ground_at = [&](const Eigen::Vector3f& ray) -> float {
    const Eigen::Vector3d direction = (track_from_camera * ray).cast<double>();
    if (direction.z() > -0.11) return 90.0F;  // beyond 25 m
    double z = -options_.texture_depth_m;
    Eigen::Vector2d place;
    for (int i = 0; i < 4; ++i) {  // the sheet bends with the grade
      place = (z - pose.height_m) / direction.z() * direction.head<2>();
      place.y() += pose.lateral_m;
      if (options_.vertical_curvature_per_m == 0) break;
      z = 0.5 * options_.vertical_curvature_per_m * place.x() * place.x() - options_.texture_depth_m;
    }
    double along = place.x();
    double left = place.y();
    if (const double k = options_.curvature_per_m; k != 0) {
      const double to_centre = 1.0 / k - place.y();
      left = 1.0 / k - std::copysign(std::hypot(place.x(), to_centre), k);
      along = std::atan2(std::copysign(1.0, k) * place.x(), std::abs(to_centre)) / k;
    }
    if (std::abs(left) > 0.78) return 90.0F;
    if (std::abs(left) > 0.68) return 220.0F;  // a rail: the same all along
    const float grey = ground(distance_m + along, left);
    return light.cast ? grey * static_cast<float>(light.cast(along, left)) : grey;
  };
  cv::Mat out(camera.height_px, camera.width_px, CV_8UC1);
  const Eigen::Vector3f quarter(0, static_cast<float>(0.25 / camera.fv_px), 0);
  size_t noise = random_.next() % noise_.size();
  for (int v = 0; v < camera.height_px; ++v) {
    for (int u = 0; u < camera.width_px; ++u) {
      const Eigen::Vector3f& ray = rays_[static_cast<size_t>(v * camera.width_px + u)];
      double grey = 0.5 * (ground_at(ray - quarter) + ground_at(ray + quarter));
      if (light.shade) grey *= light.shade(u, v);
      if (light.glare) grey += light.glare(u, v);
      if (++noise == noise_.size()) noise = 0;
      out.at<uchar>(v, u) = cv::saturate_cast<uchar>(light.gain * grey + light.bias + light.noise * noise_[noise]);
    }
  }
  return out;
}

void SyntheticGround::prepare(const geometry::Intrinsics& camera) {
  rays_.clear();
  for (int v = 0; v < camera.height_px; ++v) {
    for (int u = 0; u < camera.width_px; ++u) {
      const Eigen::Vector2d n = geometry::undistort(camera, {u, v});
      rays_.emplace_back(static_cast<float>(n.x()), static_cast<float>(n.y()), 1.0F);
    }
  }
  noise_.resize(400'009);
  for (float& value : noise_) value = static_cast<float>(random_.normal());
}

}  // namespace railfix::test
