#include "simulator/texture.hpp"

#include <algorithm>
#include <cmath>

#include "simulator/smooth_noise.hpp"

namespace railfix::simulator {
namespace {

constexpr int kStoneLog2 = 10;
constexpr float kStoneTexelM = 0.004F;
constexpr int kConcreteLog2 = 9;
constexpr float kConcreteTexelM = 0.004F;
constexpr int kVergeLog2 = 9;
constexpr float kVergeTexelM = 0.012F;

// Smooth periodic value noise with `cells` cells over the tile, in [-1, 1].
float value_noise(uint64_t seed, float x, float y, int cells) {
  return smooth_noise(x, y,
                      [&](int i, int j) { return unit_float(mix_bits(seed, i % cells, j % cells)) * 2.0F - 1.0F; });
}

// Octaves of value noise, the coarsest with `cells` cells, each next half as strong times `keep`.
float octaves(uint64_t seed, int i, int j, int size, int cells, int count, float keep) {
  float sum = 0.0F;
  float weight = 1.0F;
  for (int octave = 0; octave < count && cells <= size; ++octave, cells *= 2, weight *= keep) {
    const float scale = static_cast<float>(cells) / static_cast<float>(size);
    sum += weight * value_noise(seed + static_cast<uint64_t>(octave), static_cast<float>(i) * scale,
                                static_cast<float>(j) * scale, cells);
  }
  return sum;
}

template <class Value>
std::vector<float> fill(int log2_size, Value value) {
  const int size = 1 << log2_size;
  std::vector<float> values(static_cast<size_t>(size) * static_cast<size_t>(size));
  for (int i = 0; i < size; ++i) {
    for (int j = 0; j < size; ++j) {
      values[static_cast<size_t>(i) * static_cast<size_t>(size) + static_cast<size_t>(j)] =
          std::clamp(value(i, j, size), 0.0F, 1.0F);
    }
  }
  return values;
}

struct Stone {
  float x, y, grey, tilt_x, tilt_y;
};

// The stone of a cell of the jittered grid, in cell units.
Stone stone_in(uint64_t seed, int i, int j, int cells) {
  const int pi = (i + cells) % cells;
  const int pj = (j + cells) % cells;
  const auto draw = [&](int64_t k) { return unit_float(mix_bits(seed + static_cast<uint64_t>(k) * 7919U, pi, pj)); };
  return {static_cast<float>(i) + 0.1F + 0.8F * draw(0), static_cast<float>(j) + 0.1F + 0.8F * draw(1),
          0.30F + 0.34F * draw(2), 0.5F * (draw(3) - 0.5F), 0.5F * (draw(4) - 0.5F)};
}

float stone_grey(uint64_t seed, float x, float y, int cells) {
  const int ci = static_cast<int>(x);
  const int cj = static_cast<int>(y);
  float nearest = 9.0F;
  float second = 9.0F;
  Stone mine{};
  for (int i = ci - 1; i <= ci + 1; ++i) {
    for (int j = cj - 1; j <= cj + 1; ++j) {
      const Stone stone = stone_in(seed, i, j, cells);
      const float distance = std::hypot(x - stone.x, y - stone.y);
      if (distance < nearest) {
        second = nearest;
        nearest = distance;
        mine = stone;
      } else {
        second = std::min(second, distance);
      }
    }
  }
  // One facet a stone, darker towards the gap between it and its neighbour.
  const float facet = mine.grey + mine.tilt_x * (x - mine.x) + mine.tilt_y * (y - mine.y);
  const float gap = std::clamp((second - nearest) / 0.28F, 0.0F, 1.0F);
  return facet * (0.30F + 0.70F * gap);
}

}  // namespace

Tile::Tile(std::vector<float> values, int log2_size, float texel_m)
    : log2_size_(log2_size), per_texel_(1.0F / texel_m) {
  const int size = 1 << log2_size;
  size_t total = 0;
  for (int ls = 0; ls < log2_size; ++ls) {
    for (int ld = 0; ld < log2_size; ++ld) {
      offsets_[ls * kLevels + ld] = total;
      total += static_cast<size_t>(size >> ls) * static_cast<size_t>(size >> ld);
    }
    scale_[ls] = 1.0F / static_cast<float>(1 << ls);
  }
  values_.resize(total);
  std::vector<float> along = std::move(values);
  for (int ls = 0; ls < log2_size; ++ls) {
    const size_t rows = static_cast<size_t>(size >> ls);
    std::vector<float> both = along;
    for (int ld = 0; ld < log2_size; ++ld) {
      const size_t columns = static_cast<size_t>(size >> ld);
      uint16_t* out = values_.data() + offsets_[ls * kLevels + ld];
      for (size_t k = 0; k < rows * columns; ++k) out[k] = static_cast<uint16_t>(both[k] * 65535.0F + 0.5F);
      for (size_t k = 0; k < rows * columns / 2; ++k) both[k] = 0.5F * (both[2 * k] + both[2 * k + 1]);
    }
    const auto width = static_cast<size_t>(size);
    for (size_t row = 0; row < rows / 2; ++row) {
      for (size_t column = 0; column < width; ++column) {
        along[row * width + column] = 0.5F * (along[2 * row * width + column] + along[(2 * row + 1) * width + column]);
      }
    }
  }
}

Tile ballast_tile(uint64_t seed, float stone_m) {
  const int cells = static_cast<int>(static_cast<float>(1 << kStoneLog2) * kStoneTexelM / stone_m);
  auto values = fill(kStoneLog2, [&](int i, int j, int size) {
    const float scale = static_cast<float>(cells) / static_cast<float>(size);
    // A warp makes the stones angular and uneven instead of round.
    const float warp_x = 0.35F * octaves(seed + 11, i, j, size, 128, 2, 0.5F);
    const float warp_y = 0.35F * octaves(seed + 23, i, j, size, 128, 2, 0.5F);
    const float x = std::clamp(static_cast<float>(i) * scale + warp_x, 0.0F, static_cast<float>(cells) - 1e-3F);
    const float y = std::clamp(static_cast<float>(j) * scale + warp_y, 0.0F, static_cast<float>(cells) - 1e-3F);
    return stone_grey(seed, x, y, cells) + 0.035F * octaves(seed + 31, i, j, size, 256, 3, 0.8F) +
           0.05F * octaves(seed + 47, i, j, size, 4, 3, 0.7F);
  });
  return {std::move(values), kStoneLog2, kStoneTexelM};
}

Tile concrete_tile(uint64_t seed) {
  auto values = fill(kConcreteLog2, [&](int i, int j, int size) {
    const float grain = 0.05F * octaves(seed, i, j, size, 64, 4, 0.85F);
    const float stain = 0.07F * octaves(seed + 101, i, j, size, 4, 4, 0.6F);
    const float pore = octaves(seed + 211, i, j, size, 128, 1, 1.0F) > 0.72F ? -0.12F : 0.0F;
    return 0.56F + grain + stain + pore;
  });
  return {std::move(values), kConcreteLog2, kConcreteTexelM};
}

Tile verge_tile(uint64_t seed) {
  auto values =
      fill(kVergeLog2, [&](int i, int j, int size) { return 0.36F + 0.045F * octaves(seed, i, j, size, 8, 7, 1.05F); });
  return {std::move(values), kVergeLog2, kVergeTexelM};
}

}  // namespace railfix::simulator
