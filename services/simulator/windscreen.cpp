#include "simulator/windscreen.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "core/random.hpp"
#include "core/units.hpp"
#include "simulator/texture.hpp"

namespace railfix::simulator {
namespace {

constexpr double kParkedRad = 1.45;  // the wiper rests below the picture's edge
constexpr int kMostDrops = 650;
constexpr double kDropLifeS = 5.0;  // without a wiper it dries or runs off
constexpr int kSpots = 70;
constexpr float kDeepestDirt = 0.75F;
constexpr float kBladeCover = 0.97F;
constexpr int kBlurryStep = 16;
constexpr float kDropView = 5.0F;  // a drop shows so much more than lies behind it, upside down
constexpr float kDropRim = 0.35F;

cv::Mat dirt_map(cv::Size size, uint64_t seed) {
  const cv::Size small(std::max(8, size.width / 8), std::max(8, size.height / 8));
  cv::Mat taken(small, CV_32FC1, cv::Scalar(0));
  core::Random random(seed);
  for (int k = 0; k < kSpots; ++k) {
    const double u = random.uniform(0, small.width);
    const double v = random.uniform(0, small.height);
    const double radius = small.width * (0.006 + 0.030 * std::pow(random.uniform(), 3.0));
    const double depth = random.uniform(0.25, 1.0);
    for (int row = 0; row < small.height; ++row) {
      for (int column = 0; column < small.width; ++column) {
        const double r = std::hypot(column - u, row - v) / radius;
        if (r > 2.5) continue;
        auto& value = taken.at<float>(row, column);
        value = 1.0F - (1.0F - value) * static_cast<float>(1.0 - depth * std::exp(-r * r * r * r));
      }
    }
  }
  cv::Mat large;
  cv::resize(taken, large, size, 0, 0, cv::INTER_CUBIC);
  cv::GaussianBlur(large, large, cv::Size(), 0.004 * size.width);
  return cv::max(cv::min(large, 1.0), 0.0);
}

}  // namespace

Windscreen::Windscreen(const GlassOptions& options, cv::Size size, uint64_t seed)
    : options_(options), size_(size), seed_(seed), dirt_(dirt_map(size, mix_bits(seed, 31))) {
  options_.wiper_period_s = std::max(options_.wiper_period_s, 2.0 * options_.wiper_sweep_s);
}

void Windscreen::apply(const Look& look, cv::Mat& radiance) const {
  if (look.drops > 0.0) apply_drops(drops(look), radiance);
  if (look.dirt > 0.0) apply_dirt(static_cast<float>(look.dirt), radiance);
  if (look.wiping) apply_wiper(look.time_s, radiance);
}

std::vector<float> Windscreen::clear(const Look& look, const std::vector<Eigen::Vector2d>& pixels) const {
  const auto on_glass = look.drops > 0.0 ? drops(look) : std::vector<Drop>();
  const double angle = wiper_angle(look.time_s);
  std::vector<float> clear;
  for (const auto& pixel : pixels) {
    const auto u = static_cast<float>(pixel.x());
    const auto v = static_cast<float>(pixel.y());
    float share = 1.0F;
    if (look.wiping) share *= 1.0F - wiper_cover(angle, u, v);
    const int column = std::clamp(static_cast<int>(u), 0, size_.width - 1);
    const int row = std::clamp(static_cast<int>(v), 0, size_.height - 1);
    share *= 1.0F - kDeepestDirt * static_cast<float>(look.dirt) * dirt_.at<float>(row, column);
    const auto covers = [&](const Drop& drop) { return std::hypot(u - drop.u, v - drop.v) < drop.radius; };
    clear.push_back(std::any_of(on_glass.begin(), on_glass.end(), covers) ? 0.0F : share);
  }
  return clear;
}

// From parked to the other side and back, then a rest.
double Windscreen::wiper_angle(double time_s) const {
  const double phase = std::fmod(time_s, options_.wiper_period_s);
  if (phase > 2.0 * options_.wiper_sweep_s) return -kParkedRad;
  return -kParkedRad * std::cos(core::kPi * phase / options_.wiper_sweep_s);
}

// The blade turns about a point below the picture; angle 0 stands upright.
float Windscreen::wiper_cover(double angle, float u, float v) const {
  const float du = u - 0.5F * static_cast<float>(size_.width);
  const float dv = 1.3F * static_cast<float>(size_.height) - v;
  const auto sine = static_cast<float>(std::sin(angle));
  const auto cosine = static_cast<float>(std::cos(angle));
  if (du * sine + dv * cosine < 0.0F) return 0.0F;
  const float beside = std::abs(du * cosine - dv * sine);
  const float half = 0.5F * static_cast<float>(options_.wiper_width * size_.width);
  const float blur = 0.6F * half;
  return kBladeCover * std::clamp((half + blur - beside) / (2.0F * blur), 0.0F, 1.0F);
}

std::vector<Windscreen::Drop> Windscreen::drops(const Look& look) const {
  std::vector<Drop> drops;
  const int count = static_cast<int>(kMostDrops * std::clamp(look.drops, 0.0, 1.0));
  for (int i = 0; i < count; ++i) {
    core::Random place(mix_bits(seed_, i, 41));
    const double u = place.uniform(0, size_.width);
    const double v = place.uniform(0, size_.height);
    double clean_s = std::fmod(look.time_s + kDropLifeS * place.uniform(), kDropLifeS);
    auto life = static_cast<int64_t>((look.time_s + kDropLifeS) / kDropLifeS);
    if (look.wiping) {
      // Since the blade went over this place last: there, back, or before the rest.
      const double angle = std::atan2(u - 0.5 * size_.width, 1.3 * size_.height - v);
      const double there_s = options_.wiper_sweep_s * std::acos(std::clamp(-angle / kParkedRad, -1.0, 1.0)) / core::kPi;
      const double back_s = 2.0 * options_.wiper_sweep_s - there_s;
      const double phase = std::fmod(look.time_s, options_.wiper_period_s);
      clean_s = phase >= back_s ? phase - back_s
                                : (phase >= there_s ? phase - there_s : phase - back_s + options_.wiper_period_s);
      life = 3 * static_cast<int64_t>(look.time_s / options_.wiper_period_s) + (phase >= there_s) + (phase >= back_s);
    }
    core::Random fate(mix_bits(seed_, i * 100'003LL + life, 42));
    const double born_s = fate.uniform() * kDropLifeS * 0.8;
    if (clean_s < born_s) continue;
    const double radius = size_.width * (0.003 + 0.016 * std::pow(fate.uniform(), 4.0));
    const double run = 0.3 * radius * (clean_s - born_s);
    drops.push_back({static_cast<float>(u + radius * 2.0 * fate.uniform(-1, 1)), static_cast<float>(v + run),
                     static_cast<float>(radius)});
  }
  return drops;
}

void Windscreen::apply_dirt(float strength, cv::Mat& radiance) const {
  // What the dirt takes it scatters, so that it veils the dark and dims the bright.
  const float veil = 0.35F * static_cast<float>(cv::mean(radiance)[0]);
  for (int v = 0; v < radiance.rows; ++v) {
    const float* taken = dirt_.ptr<float>(v);
    float* row = radiance.ptr<float>(v);
    for (int u = 0; u < radiance.cols; ++u) {
      const float share = kDeepestDirt * strength * taken[u];
      row[u] += share * (veil - row[u]);
    }
  }
}

void Windscreen::apply_drops(const std::vector<Drop>& drops, cv::Mat& radiance) const {
  cv::Mat blurry;
  cv::resize(radiance, blurry, cv::Size(), 1.0 / kBlurryStep, 1.0 / kBlurryStep, cv::INTER_AREA);
  const auto behind = [&](float u, float v) {
    const float x = std::clamp(u / kBlurryStep, 0.0F, static_cast<float>(blurry.cols) - 1.01F);
    const float y = std::clamp(v / kBlurryStep, 0.0F, static_cast<float>(blurry.rows) - 1.01F);
    const int i = static_cast<int>(x);
    const int j = static_cast<int>(y);
    const float wx = x - static_cast<float>(i);
    const float wy = y - static_cast<float>(j);
    const float* a = blurry.ptr<float>(j) + i;
    const float* b = blurry.ptr<float>(j + 1) + i;
    return (a[0] + wx * (a[1] - a[0])) * (1.0F - wy) + (b[0] + wx * (b[1] - b[0])) * wy;
  };
  for (const auto& drop : drops) {
    const int top = std::max(0, static_cast<int>(drop.v - drop.radius));
    const int bottom = std::min(radiance.rows - 1, static_cast<int>(drop.v + drop.radius) + 1);
    const int left = std::max(0, static_cast<int>(drop.u - drop.radius));
    const int right = std::min(radiance.cols - 1, static_cast<int>(drop.u + drop.radius) + 1);
    for (int v = top; v <= bottom; ++v) {
      float* row = radiance.ptr<float>(v);
      for (int u = left; u <= right; ++u) {
        const float du = static_cast<float>(u) - drop.u;
        const float dv = static_cast<float>(v) - drop.v;
        const float r2 = (du * du + dv * dv) / (drop.radius * drop.radius);
        if (r2 >= 1.0F) continue;
        const float share = std::min(1.0F, (1.0F - r2) / 0.45F);
        const float seen = behind(drop.u - kDropView * du, drop.v - kDropView * dv) * (1.0F - kDropRim * r2);
        row[u] += share * (seen - row[u]);
      }
    }
  }
}

void Windscreen::apply_wiper(double time_s, cv::Mat& radiance) const {
  const double angle = wiper_angle(time_s);
  if (angle <= -kParkedRad + 1e-6) return;
  const double reach = 0.8 * options_.wiper_width * size_.width / std::max(0.05, std::cos(angle)) + 2.0;
  for (int v = 0; v < radiance.rows; ++v) {
    const double middle = 0.5 * size_.width + std::tan(angle) * (1.3 * size_.height - v);
    if (middle + reach < 0.0 || middle - reach > radiance.cols) continue;
    float* row = radiance.ptr<float>(v);
    const int first = std::max(0, static_cast<int>(middle - reach));
    const int last = std::min(radiance.cols - 1, static_cast<int>(middle + reach));
    for (int u = first; u <= last; ++u)
      row[u] *= 1.0F - wiper_cover(angle, static_cast<float>(u), static_cast<float>(v));
  }
}

}  // namespace railfix::simulator
