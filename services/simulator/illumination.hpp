// How much light falls on a place of the line: sky, sun, tunnels and the train's headlamp.
#pragma once

#include <algorithm>
#include <vector>

#include "simulator/line.hpp"
#include "simulator/look.hpp"
#include "simulator/shadow_field.hpp"

namespace railfix::simulator {

/// For one picture; s, x, y in metres from the camera's foot (s along the track, x forward, y left).
class Illumination {
 public:
  Illumination(const Line& line, const Light& light, double distance_m);
  /// With shadows of trees and clouds that take the share `depth` of the sun's light.
  void cast(const ShadowField::Slice& shadows, double depth) {
    shadows_ = shadows;
    shadow_depth_ = static_cast<float>(depth);
  }
  /// Share of the sun's light that shadows leave.
  [[nodiscard]] float sunlit(float s_m, float d_m, float size_s_m, float size_d_m) const {
    if (shadow_depth_ <= 0.0F) return 1.0F;
    return 1.0F - shadow_depth_ * (1.0F - shadows_.lit(s_m, d_m, size_s_m, size_d_m));
  }

  /// 1 = a bright diffuse day.
  struct Level {
    float diffuse;  // of sky, tunnel mouths and headlamp
    float direct;   // of the sun, where no shadow lies
  };
  [[nodiscard]] Level on_ground(float s_m, float x_m, float y_m) const;
  /// The same for something upright, all together.
  [[nodiscard]] float on_object(float s_m, float x_m, float y_m) const {
    const Level level = on_ground(s_m, x_m, y_m);
    return level.diffuse + level.direct;
  }
  /// What the air between leaves of an albedo.
  [[nodiscard]] float hazy(float albedo, float x_m) const {
    return albedo + (kHaze - albedo) * std::min(1.0F, x_m * per_haze_m_);
  }
  /// Ground further beside the path is not in a tunnel.
  [[nodiscard]] float tunnel_reach_m() const { return tunnel_reach_m_; }
  /// True where all places of the picture have the same light.
  [[nodiscard]] bool uniform() const { return tunnels_.empty() && light_.sky + light_.sun >= 1.0; }
  [[nodiscard]] const Light& open() const { return light_; }

 private:
  static constexpr float kHaze = 0.62F;
  Light light_;
  ShadowField::Slice shadows_{};
  float shadow_depth_ = 0;
  float per_haze_m_;
  std::vector<Span> tunnels_;
  float tunnel_reach_m_ = 0;
};

}  // namespace railfix::simulator
