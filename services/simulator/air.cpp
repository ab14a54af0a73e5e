#include "simulator/air.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "core/random.hpp"
#include "simulator/texture.hpp"

namespace railfix::simulator {
namespace {

struct Box {
  double near_m, far_m, half_width_m, below_m, above_m;  // before the camera
};
constexpr Box kRainBox{0.8, 13.0, 5.0, 2.2, 3.0};
constexpr Box kLeafBox{1.5, 16.0, 6.0, 2.2, 3.5};
constexpr int kMostDrops = 2500;
constexpr int kMostLeaves = 90;
constexpr double kRainFallMps = 7.0;
constexpr double kLeafFallMps = 1.1;
constexpr double kDropM = 0.003;
constexpr double kLeafM = 0.035;
constexpr int kGlareStep = 8;

double wrapped(double value, double low, double high) {
  const double length = high - low;
  return low + (value - low) - length * std::floor((value - low) / length);
}

// A soft disc: its share of a pixel falls from the middle to the rim.
void dab(cv::Mat& radiance, double u, double v, double radius, float share, float grey) {
  const int top = std::max(0, static_cast<int>(std::floor(v - radius - 1.0)));
  const int bottom = std::min(radiance.rows - 1, static_cast<int>(std::ceil(v + radius + 1.0)));
  const int left = std::max(0, static_cast<int>(std::floor(u - radius - 1.0)));
  const int right = std::min(radiance.cols - 1, static_cast<int>(std::ceil(u + radius + 1.0)));
  for (int row = top; row <= bottom; ++row) {
    float* out = radiance.ptr<float>(row);
    for (int column = left; column <= right; ++column) {
      const double inside = radius + 0.5 - std::hypot(column - u, row - v);
      if (inside > 0.0) out[column] += share * static_cast<float>(std::min(inside, 1.0)) * (grey - out[column]);
    }
  }
}

struct Streak {
  Eigen::Vector2d begin, end;
  double depth_m;
  Eigen::Vector3d place;
};
std::optional<Streak> streak_of(const geometry::View& view, const InTheAir& air, const Eigen::Vector3d& place,
                                double fall_mps) {
  const Eigen::Vector3d half = 0.5 * air.exposure_s * Eigen::Vector3d(-air.speed_mps, 0.0, -fall_mps);
  const auto begin = view.project(place - half);
  const auto end = view.project(place + half);
  if (!begin || !end || (*end - *begin).norm() > 200.0) return std::nullopt;
  return Streak{*begin, *end, place.x(), place};
}

void draw(const Streak& streak, double size_m, double focal_px, float opacity, float grey, cv::Mat& radiance) {
  const double radius = std::max(0.7, 0.5 * size_m * focal_px / streak.depth_m);
  const Eigen::Vector2d way = streak.end - streak.begin;
  const int dabs = std::max(1, static_cast<int>(std::ceil(way.norm() / radius)));
  // A moving thing covers every place for a part of the exposure only.
  const float share = opacity * static_cast<float>(std::min(1.0, 2.0 * radius / (way.norm() + 2.0 * radius)));
  for (int i = 0; i <= dabs; ++i) {
    const Eigen::Vector2d at = streak.begin + way * (static_cast<double>(i) / dabs);
    dab(radiance, at.x(), at.y(), radius, share, grey);
  }
}

Eigen::Vector3d place_in(const Box& box, uint64_t bits, const InTheAir& air, double fallen_m) {
  core::Random random(bits);
  const double x = wrapped(random.uniform(box.near_m, box.far_m) - air.distance_m, box.near_m, box.far_m);
  const double y = random.uniform(-box.half_width_m, box.half_width_m);
  const double z = wrapped(random.uniform(-box.below_m, box.above_m) - fallen_m, -box.below_m, box.above_m);
  return {x, y, air.pose.height_m + z};
}

}  // namespace

void draw_rain(const InTheAir& air, const Look& look, const Illumination& light, cv::Mat& radiance) {
  const geometry::View view(air.camera, air.pose);
  const int count = static_cast<int>(kMostDrops * look.rain);
  for (int i = 0; i < count; ++i) {
    const auto place = place_in(kRainBox, mix_bits(air.seed, i, 51), air, kRainFallMps * look.time_s);
    const auto streak = streak_of(view, air, place, kRainFallMps);
    if (!streak) continue;
    const auto x = static_cast<float>(place.x());
    const float level = light.on_object(x, x, static_cast<float>(place.y()));
    draw(*streak, kDropM, air.camera.fu_px, 0.6F, level, radiance);
  }
}

void draw_leaves(const InTheAir& air, const Look& look, const Illumination& light, cv::Mat& radiance) {
  const geometry::View view(air.camera, air.pose);
  const int count = static_cast<int>(kMostLeaves * look.leaves);
  for (int i = 0; i < count; ++i) {
    auto place = place_in(kLeafBox, mix_bits(air.seed, i, 52), air, kLeafFallMps * look.time_s);
    const double phase = 6.28 * static_cast<double>(unit_float(mix_bits(air.seed, i, 53)));
    place.y() += 0.25 * std::sin(2.3 * look.time_s + phase);
    const auto streak = streak_of(view, air, place, kLeafFallMps);
    if (!streak) continue;
    const auto x = static_cast<float>(place.x());
    const float albedo = 0.16F + 0.34F * unit_float(mix_bits(air.seed, i, 54));
    draw(*streak, kLeafM * (0.7 + 0.6 * std::abs(std::sin(5.0 * look.time_s + phase))), air.camera.fu_px, 0.95F,
         albedo * light.on_object(x, x, static_cast<float>(place.y())), radiance);
  }
}

Glare::Glare(const InTheAir& air, const Illumination& light) {
  const auto& open = light.open();
  const float sun = light.on_ground(0.0F, 0.0F, 0.0F).direct;
  const double left = air.heading_rad - open.sun_heading_rad;
  const Eigen::Vector3d towards(std::cos(open.sun_elevation_rad) * std::cos(left),
                                std::cos(open.sun_elevation_rad) * std::sin(left), std::sin(open.sun_elevation_rad));
  const auto pixel = geometry::View(air.camera, air.pose)
                         .project(1e4 * towards + Eigen::Vector3d(0.0, air.pose.lateral_m, air.pose.height_m));
  if (sun <= 0.0F || !pixel) return;
  width_px_ = static_cast<float>(air.camera.width_px);
  if ((*pixel - Eigen::Vector2d(air.camera.cu_px, air.camera.cv_px)).norm() > 1.5 * air.camera.width_px) return;
  any_ = true;
  sun_u_ = static_cast<float>(pixel->x());
  sun_v_ = static_cast<float>(pixel->y());
  strength_ = sun;
}

float Glare::at(double u_px, double v_px) const {
  if (!any_) return 0.0F;
  const float du = (static_cast<float>(u_px) - sun_u_) / width_px_;
  const float dv = (static_cast<float>(v_px) - sun_v_) / width_px_;
  const float r = std::sqrt(du * du + dv * dv);
  // Disc, bloom and the veil that the lens lays over everything.
  const float disc = 6.0F * std::exp(-(r * r) / (0.018F * 0.018F));
  return strength_ * (disc + 0.70F * std::exp(-r / 0.08F) + 0.17F * std::exp(-r / 0.45F));
}

void Glare::apply(cv::Mat& radiance) const {
  if (!any_) return;
  // Smooth, so a coarse grid is enough.
  cv::Mat coarse(radiance.rows / kGlareStep + 2, radiance.cols / kGlareStep + 2, CV_32FC1);
  for (int v = 0; v < coarse.rows; ++v) {
    for (int u = 0; u < coarse.cols; ++u) coarse.at<float>(v, u) = at(u * kGlareStep, v * kGlareStep);
  }
  for (int v = 0; v < radiance.rows; ++v) {
    const float wv = static_cast<float>(v % kGlareStep) / kGlareStep;
    const float* a = coarse.ptr<float>(v / kGlareStep);
    const float* b = coarse.ptr<float>(v / kGlareStep + 1);
    float* row = radiance.ptr<float>(v);
    for (int u = 0; u < radiance.cols; ++u) {
      const int i = u / kGlareStep;
      const float wu = static_cast<float>(u % kGlareStep) / kGlareStep;
      const float left = a[i] + wv * (b[i] - a[i]);
      const float right = a[i + 1] + wv * (b[i + 1] - a[i + 1]);
      row[u] += left + wu * (right - left);
    }
  }
}

}  // namespace railfix::simulator
