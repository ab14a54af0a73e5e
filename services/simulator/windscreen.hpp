// The windscreen before the camera: rain drops, dirt and the wiper, all out of focus.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "simulator/look.hpp"

namespace railfix::simulator {

struct GlassOptions {
  double wiper_period_s = 2.0;  // from wipe to wipe
  double wiper_sweep_s = 0.6;   // one way
  double wiper_width = 0.03;    // of the picture's width
};

/// Read-only after it is made; may be used from many threads.
class Windscreen {
 public:
  Windscreen(const GlassOptions& options, cv::Size size, uint64_t seed);

  /// Changes what was drawn behind the glass. radiance: CV_32FC1.
  void apply(const Look& look, cv::Mat& radiance) const;
  /// Share of the light at each pixel that comes straight through; a drop lets none through.
  [[nodiscard]] std::vector<float> clear(const Look& look, const std::vector<Eigen::Vector2d>& pixels) const;

 private:
  struct Drop {
    float u, v, radius;
  };
  [[nodiscard]] double wiper_angle(double time_s) const;
  [[nodiscard]] float wiper_cover(double angle, float u, float v) const;
  [[nodiscard]] std::vector<Drop> drops(const Look& look) const;
  void apply_dirt(float strength, cv::Mat& radiance) const;
  void apply_drops(const std::vector<Drop>& drops, cv::Mat& radiance) const;
  void apply_wiper(double time_s, cv::Mat& radiance) const;

  GlassOptions options_;
  cv::Size size_;
  uint64_t seed_;
  cv::Mat dirt_;  // CV_32FC1, share of the light that dirt takes at strength 1
};

}  // namespace railfix::simulator
