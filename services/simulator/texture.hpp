// Surfaces seen at any distance: periodic grey tiles with means over boxes of any power-of-two shape (a rip-map), so
// that a far or motion-blurred surface neither shimmers nor loses its detail across the track.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace railfix::simulator {

/// 64 well mixed bits of up to three numbers (splitmix64 finaliser).
constexpr uint64_t mix_bits(uint64_t seed, int64_t a, int64_t b = 0) {
  uint64_t z =
      seed + 0x9E3779B97F4A7C15ULL * static_cast<uint64_t>(a) + 0xC2B2AE3D27D4EB4FULL * static_cast<uint64_t>(b);
  z = (z ^ (z >> 30U)) * 0xBF58476D1CE4E5B9ULL;
  z = (z ^ (z >> 27U)) * 0x94D049BB133111EBULL;
  return z ^ (z >> 31U);
}
/// In [0, 1).
constexpr float unit_float(uint64_t bits) {
  return static_cast<float>(bits >> 40U) * 0x1.0p-24F;
}

/// Square periodic tile, 2^log2_size texels a side of texel_m metres, values 0..1. First axis s (along), second d.
class Tile {
 public:
  Tile(std::vector<float> values, int log2_size, float texel_m);

  /// Mean over about footprint_s x footprint_d metres around (s, d); continuous in s, d and footprint_s.
  [[nodiscard]] float mean(float s_m, float d_m, float footprint_s_m, float footprint_d_m) const {
    const float level_s = level(footprint_s_m);
    const int ls = static_cast<int>(level_s);
    const int ld = static_cast<int>(level(footprint_d_m) + 0.35F);
    const float w = level_s - static_cast<float>(ls);
    const float s = s_m * per_texel_;
    const float d = d_m * per_texel_;
    const float fine = bilinear(ls, ld, s, d);
    if (ls >= log2_size_ - 1) return fine;
    return fine + w * (bilinear(ls + 1, ld, s, d) - fine);
  }
  [[nodiscard]] float period_m() const { return static_cast<float>(1 << log2_size_) / per_texel_; }

 private:
  // Piecewise linear log2, which is all that blending needs.
  [[nodiscard]] float level(float footprint_m) const {
    const uint32_t bits = std::bit_cast<uint32_t>(footprint_m * per_texel_);
    const float log2 = static_cast<float>(static_cast<int32_t>(bits) - 0x3F800000) * (1.0F / 8388608.0F);
    const float top = static_cast<float>(log2_size_ - 1);
    return log2 < 0.0F ? 0.0F : (log2 > top ? top : log2);
  }
  [[nodiscard]] float bilinear(int ls, int ld, float s, float d) const {
    const int rows = 1 << (log2_size_ - ls);
    const int columns = 1 << (log2_size_ - ld);
    // Texel i of a level is centred at (i + 1/2) of its size; the offset keeps the conversion to int a floor.
    constexpr float kPositive = 1 << 14;
    const float row = s * scale_[ls] - 0.5F + kPositive;
    const float column = d * scale_[ld] - 0.5F + kPositive;
    const int i = static_cast<int>(row);
    const int j = static_cast<int>(column);
    const float ws = row - static_cast<float>(i);
    const float wd = column - static_cast<float>(j);
    const uint16_t* texels = values_.data() + offsets_[ls * kLevels + ld];
    const uint16_t* a = texels + static_cast<ptrdiff_t>(i & (rows - 1)) * columns;
    const uint16_t* b = texels + static_cast<ptrdiff_t>((i + 1) & (rows - 1)) * columns;
    const int j0 = j & (columns - 1);
    const int j1 = (j + 1) & (columns - 1);
    const float upper = static_cast<float>(a[j0]) + wd * static_cast<float>(a[j1] - a[j0]);
    const float lower = static_cast<float>(b[j0]) + wd * static_cast<float>(b[j1] - b[j0]);
    return (upper + ws * (lower - upper)) * (1.0F / 65535.0F);
  }
  static constexpr int kLevels = 12;
  std::vector<uint16_t> values_;
  size_t offsets_[kLevels * kLevels] = {};
  float scale_[kLevels] = {};
  int log2_size_;
  float per_texel_;
};

/// Broken stones of about stone_m, dark gaps between them.
Tile ballast_tile(uint64_t seed, float stone_m);
/// Concrete of sleepers: fine grain, pores, stains.
Tile concrete_tile(uint64_t seed);
/// Ground beside the track: grass and earth.
Tile verge_tile(uint64_t seed);

}  // namespace railfix::simulator
