#include "simulator/illumination.hpp"

#include <algorithm>
#include <cmath>

namespace railfix::simulator {
namespace {

constexpr double kSightM = 320.0;
constexpr float kAmbient = 0.012F;  // of a tunnel without lamps
constexpr float kDaylightReachM = 4.0F;
constexpr float kSunReachM = 1.5F;

// Two cones: the beam, and a wide weak one for the ground before the train.
float headlamp(float x_m, float y_m) {
  const float ahead = std::max(x_m, 4.0F);
  const float azimuth = y_m / ahead;
  const float beam = std::exp(-azimuth * azimuth * (1.0F / (0.30F * 0.30F)));
  const float wide = 1.0F / (1.0F + 2.0F * azimuth * azimuth);
  return beam * 0.16F * std::min(1.0F, 100.0F / (ahead * ahead)) + wide * 0.05F * std::min(1.0F, 12.0F / ahead);
}

}  // namespace

Illumination::Illumination(const Line& line, const Light& light, double distance_m)
    : light_(light), per_haze_m_(static_cast<float>(1.0 / light.haze_m)) {
  for (const auto& tunnel : line.tunnels()) {
    if (tunnel.begin_m - distance_m > kSightM || tunnel.end_m < distance_m - kSightM) continue;
    tunnels_.push_back({tunnel.begin_m - distance_m, tunnel.end_m - distance_m, 0.0});
    tunnel_reach_m_ = std::max(tunnel_reach_m_, static_cast<float>(std::max(tunnel.left_m, -tunnel.right_m)) + 0.1F);
  }
}

Illumination::Level Illumination::on_ground(float s_m, float x_m, float y_m) const {
  float daylight = 1.0F;
  float sunlight = 1.0F;
  for (const auto& tunnel : tunnels_) {
    const float in = s_m - static_cast<float>(tunnel.begin_m);
    const float out = static_cast<float>(tunnel.end_m) - s_m;
    if (in <= 0.0F || out <= 0.0F) continue;
    daylight = std::min(1.0F, kAmbient + std::exp(-in / kDaylightReachM) + std::exp(-out / kDaylightReachM));
    sunlight = std::max(std::exp(-in / kSunReachM), std::exp(-out / kSunReachM));
  }
  Level level{daylight * static_cast<float>(light_.sky), sunlight * static_cast<float>(light_.sun)};
  const float dark = 1.0F - level.diffuse - level.direct;
  if (dark > 0.0F) level.diffuse += dark * static_cast<float>(light_.headlamp) * headlamp(x_m, y_m);
  return level;
}

}  // namespace railfix::simulator
