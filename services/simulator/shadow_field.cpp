#include "simulator/shadow_field.hpp"

#include <algorithm>
#include <cmath>

#include "simulator/smooth_noise.hpp"

namespace railfix::simulator {
namespace {

constexpr int kLog2 = 9;
constexpr int kTexelsPerShadow = 24;

// Smooth noise in [0, 1], periodic over the tile; x and y from 0 to 1.
float lattice(uint64_t seed, float at_x, float at_y, int cells_x, int cells_y) {
  const float x = at_x * static_cast<float>(cells_x);
  const float y = at_y * static_cast<float>(cells_y);
  return smooth_noise(x, y, [&](int i, int j) { return unit_float(mix_bits(seed, i % cells_x, j % cells_y)); });
}

// Crowns with smaller branches: two octaves of noise, cut where half of it is light.
Tile shadow_tile(uint64_t seed, const ShadowShape& shape) {
  constexpr int kSize = 1 << kLog2;
  constexpr int kCells = kSize / kTexelsPerShadow;
  const auto soft = static_cast<float>(std::max(0.01, 0.5 * shape.softness));
  std::vector<float> values(static_cast<size_t>(kSize) * kSize);
  for (int i = 0; i < kSize; ++i) {
    for (int j = 0; j < kSize; ++j) {
      const float x = static_cast<float>(i) / kSize;
      const float y = static_cast<float>(j) / kSize;
      // Longer across the track than along it, as shadows of a row of trees are.
      const float crowns = lattice(seed, x, y, kCells, kCells / 2);
      const float boughs = lattice(seed + 1, x, y, 3 * kCells, 2 * kCells);
      const float twigs = lattice(seed + 2, x, y, 8 * kCells, 6 * kCells);
      const float value = crowns + 0.35F * (boughs - 0.5F) + 0.20F * (twigs - 0.5F);
      values[static_cast<size_t>(i) * kSize + static_cast<size_t>(j)] =
          std::clamp((value - 0.5F + soft) / (2.0F * soft), 0.0F, 1.0F);
    }
  }
  return {std::move(values), kLog2, static_cast<float>(shape.length_m / kTexelsPerShadow)};
}

}  // namespace

ShadowField::ShadowField(const ShadowShape& shape, uint64_t seed) : shape_(shape), tile_(shadow_tile(seed, shape)) {}

ShadowField::Slice ShadowField::slice(double distance_m, double time_s) const {
  const double period = static_cast<double>(tile_.period_m());
  return {&tile_, static_cast<float>(std::fmod(distance_m - shape_.speed_mps * time_s, period)),
          static_cast<float>(shape_.slant)};
}

}  // namespace railfix::simulator
