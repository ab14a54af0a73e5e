// Shadows of trees and clouds on the open line, that move or stand.
#pragma once

#include "simulator/texture.hpp"

namespace railfix::simulator {

struct ShadowShape {
  double length_m = 3.0;  // of a shadow along the track
  double softness = 0.15;
  double slant = 0.6;  // metres along the track per metre to the left
  double speed_mps = 0.0;
};

class ShadowField {
 public:
  ShadowField(const ShadowShape& shape, uint64_t seed);

  /// One picture's share of it.
  struct Slice {
    const Tile* tile = nullptr;
    float offset_m = 0;  // of the camera's foot in the field
    float slant = 0;
    /// 1 in the light to 0 in the shadow at a place; sizes: of the pixel on the ground.
    [[nodiscard]] float lit(float s_m, float d_m, float size_s_m, float size_d_m) const {
      return tile->mean(s_m + offset_m + slant * d_m, d_m, size_s_m, size_d_m);
    }
  };
  [[nodiscard]] Slice slice(double distance_m, double time_s) const;

 private:
  ShadowShape shape_;
  Tile tile_;
};

}  // namespace railfix::simulator
