#include "simulator/ground_shader.hpp"

#include <cmath>

namespace railfix::simulator {
namespace {

constexpr float kBehindM = 12.0F;  // tables begin here behind the foot (multiple of every cell)
constexpr float kTableM = 290.0F;
constexpr float kSleeperWidthM = 0.27F;
constexpr float kPatchM = 2.4F;
constexpr float kPatchBlend = 0.2F;
constexpr float kRailMiddleM = kHalfGaugeM + 0.5F * kHeadWidthM;
constexpr float kFarSideM = 9.0F;
constexpr float kRailsEndM = 1.5F;  // nothing of the rails further out
constexpr float kHalfFootM = 0.075F;
constexpr float kBaliseHalfLengthM = 0.18F;
constexpr float kBaliseHalfWidthM = 0.24F;
constexpr float kBaliseDepthM = 0.12F;
constexpr float kBallastEdgeM = 2.1F;
constexpr float kRaggedPeriodM = 12.0F;
constexpr float kRagged = 6.2831853F / kRaggedPeriodM;

// Share of an interval of `size` around x that lies in [low, high].
float cover(float x, float low, float high, float size) {
  const float a = std::max(low, x - 0.5F * size);
  const float b = std::min(high, x + 0.5F * size);
  return b > a ? (b - a) / size : 0.0F;
}

// Phase of `distance` in cells of `cell`, and the index of the first cell in a table that begins kBehindM behind.
struct Phase {
  float phase_m;
  int64_t first;
};
Phase phase_of(double distance_m, float cell_m) {
  const double cell = static_cast<double>(cell_m);
  const double index = std::floor(distance_m / cell);
  return {static_cast<float>(distance_m - index * cell),
          static_cast<int64_t>(index) - static_cast<int64_t>(std::lround(kBehindM / cell_m))};
}

}  // namespace

GroundShader::GroundShader(const Line& line, const RenderOptions& options, const Tiles& tiles, double distance_m)
    : tiles_(tiles),
      sleeper_depth_m_(static_cast<float>(options.texture_depth_m)),
      ballast_depth_m_(static_cast<float>(options.ballast_depth_m)) {
  constexpr auto kPitch = static_cast<float>(kSleeperPitchM);
  const auto sleeper_phase = phase_of(distance_m, kPitch);
  sleeper_phase_m_ = sleeper_phase.phase_m + kBehindM;
  for (int64_t k = 0; static_cast<float>(k) * kPitch < kTableM; ++k) {
    const auto bits = mix_bits(options.seed, sleeper_phase.first + k, 1);
    const auto more = mix_bits(options.seed, sleeper_phase.first + k, 2);
    sleepers_.push_back({static_cast<float>(k) * kPitch - sleeper_phase_m_,
                         0.5F * kPitch + 0.03F * (unit_float(bits) - 0.5F), 0.85F + 0.3F * unit_float(bits << 20U),
                         unit_float(more) * 2.0F, unit_float(more << 24U) * 2.0F});
  }
  const auto patch_phase = phase_of(distance_m, kPatchM);
  patch_phase_m_ = patch_phase.phase_m + kBehindM;
  for (int64_t k = 0; static_cast<float>(k) * kPatchM < kTableM; ++k) {
    const auto bits = mix_bits(options.seed, patch_phase.first + k, 3);
    patches_.push_back({unit_float(bits) * 4.096F, unit_float(bits << 24U) * 4.096F});
  }
  ragged_phase_m_ = phase_of(distance_m, kRaggedPeriodM).phase_m;
  const auto rail_phase = phase_of(distance_m, 1.0F);
  rail_phase_m_ = rail_phase.phase_m + kBehindM;
  for (int64_t k = 0; static_cast<float>(k) < kTableM; ++k) {
    rail_grey_.push_back(0.92F + 0.12F * unit_float(mix_bits(options.seed, rail_phase.first + k, 4)));
  }
  for (const auto& balise : line.balises()) {
    if (std::abs(balise.distance_m - distance_m) < 120.0)
      balises_.push_back({balise.distance_m - distance_m, balise.lateral_m});
  }
}

// Patches of a tile at random offsets, cross-faded at their borders: no repetition along the line.
float GroundShader::patchwork(const Tile& tile, float s_m, float d_m, const GroundPixel& pixel) const {
  const float position = (s_m + patch_phase_m_) * (1.0F / kPatchM);
  const int index = std::clamp(static_cast<int>(position), 0, static_cast<int>(patches_.size()) - 2);
  const float within = position - static_cast<float>(index);
  const auto at = [&](int i) {
    const Patch& patch = patches_[static_cast<size_t>(i)];
    const float local = s_m + patch_phase_m_ - static_cast<float>(i) * kPatchM;
    return tile.mean(local + patch.s, d_m + patch.d, pixel.size_s_m, pixel.size_d_m);
  };
  const float here = at(index);
  if (within < 1.0F - kPatchBlend) return here;
  const float w = std::min(1.0F, (within - (1.0F - kPatchBlend)) * (1.0F / kPatchBlend));
  return here + w * (at(index + 1) - here);
}

const GroundShader::Sleeper& GroundShader::sleeper(float s_m) const {
  const int index = static_cast<int>((s_m + sleeper_phase_m_) * static_cast<float>(1.0 / kSleeperPitchM));
  return sleepers_[static_cast<size_t>(std::clamp(index, 0, static_cast<int>(sleepers_.size()) - 1))];
}

// Metres of sleeper between the table's beginning and s: its differences are exact means over any length.
float GroundShader::sleepers_before(float s_m) const {
  constexpr auto kPitch = static_cast<float>(kSleeperPitchM);
  const float position = s_m + sleeper_phase_m_;
  const int index = std::clamp(static_cast<int>(position / kPitch), 0, static_cast<int>(sleepers_.size()) - 1);
  const float begin =
      static_cast<float>(index) * kPitch + sleepers_[static_cast<size_t>(index)].middle_m - 0.5F * kSleeperWidthM;
  return static_cast<float>(index) * kSleeperWidthM + std::clamp(position - begin, 0.0F, kSleeperWidthM);
}

float GroundShader::foot_and_web(const GroundPixel& pixel, float below) {
  if (std::abs(pixel.at.d_m) > kRailsEndM) return below;
  const float above = std::abs(pixel.at.d_m);
  const float d = std::abs(pixel.at.d_m + pixel.slope_d * kRailFootDepthM);
  const float foot = cover(d, kRailMiddleM - kHalfFootM, kRailMiddleM + kHalfFootM, pixel.edge_d_m);
  float albedo = below + foot * (0.17F - below);
  // A ray that changes sides of the rail on its way down meets the web.
  const float web = above < kRailMiddleM ? cover(d, kRailMiddleM, kFarSideM, pixel.edge_d_m)
                                         : cover(d, 0.0F, kRailMiddleM, pixel.edge_d_m);
  albedo += web * (0.09F - albedo);
  return albedo;
}

float GroundShader::balises(const GroundPixel& pixel, float below) const {
  const float s = pixel.at.s_m + pixel.slope_s * kBaliseDepthM;
  const float d = pixel.at.d_m + pixel.slope_d * kBaliseDepthM;
  float albedo = below;
  for (const auto& balise : balises_) {
    const float ds = s - static_cast<float>(balise.distance_m);
    const float dd = d - static_cast<float>(balise.lateral_m);
    if (std::abs(ds) > 0.5F + pixel.size_s_m || std::abs(dd) > 0.5F) continue;
    const float ground_s = ds + pixel.slope_s * (sleeper_depth_m_ - kBaliseDepthM);
    const float ground_d = dd + pixel.slope_d * (sleeper_depth_m_ - kBaliseDepthM);
    const float shadow = cover(ground_s, -kBaliseHalfLengthM, kBaliseHalfLengthM + 0.02F, pixel.size_s_m) *
                         cover(ground_d, -kBaliseHalfWidthM - 0.02F, kBaliseHalfWidthM + 0.02F, pixel.edge_d_m);
    albedo += shadow * (0.10F - albedo);
    const float plate = cover(ds, -kBaliseHalfLengthM, kBaliseHalfLengthM, pixel.size_s_m) *
                        cover(dd, -kBaliseHalfWidthM, kBaliseHalfWidthM, pixel.edge_d_m);
    const float field = cover(ds, -kBaliseHalfLengthM + 0.04F, kBaliseHalfLengthM - 0.04F, pixel.size_s_m) *
                        cover(dd, -kBaliseHalfWidthM + 0.04F, kBaliseHalfWidthM - 0.04F, pixel.edge_d_m);
    albedo += plate * (0.66F + 0.10F * field - albedo);
  }
  return albedo;
}

float GroundShader::ground(const GroundPixel& pixel, const Reach& reach) const {
  const float ballast_s = pixel.at.s_m + pixel.slope_s * ballast_depth_m_;
  const float ballast_d = pixel.at.d_m + pixel.slope_d * ballast_depth_m_;
  const float edge = kBallastEdgeM - 1.3F + (ballast_d > 0.0F ? reach.left_m : reach.right_m);
  float beside = std::abs(ballast_d) > edge ? 1.0F : 0.0F;
  if (std::abs(std::abs(ballast_d) - edge) < 0.7F) {
    const float ragged = 0.25F * std::sin((ballast_s + ragged_phase_m_) * kRagged) *
                         std::sin((ballast_s + ragged_phase_m_) * 4.0F * kRagged);
    beside = std::clamp((std::abs(ballast_d) - edge - ragged) * 2.5F, 0.0F, 1.0F);
  }
  float albedo = beside < 1.0F ? patchwork(tiles_.ballast, ballast_s, ballast_d, pixel) : 0.0F;
  if (beside > 0.0F) {
    const float verge = patchwork(tiles_.verge, ballast_s, ballast_d, pixel);
    albedo += beside * (verge - albedo);
  }
  const float s = pixel.at.s_m + pixel.slope_s * sleeper_depth_m_;
  const float d = pixel.at.d_m + pixel.slope_d * sleeper_depth_m_;
  if (d < reach.left_m + 0.2F && d > -reach.right_m - 0.2F) {
    const float along =
        (sleepers_before(s + 0.5F * pixel.size_s_m) - sleepers_before(s - 0.5F * pixel.size_s_m)) / pixel.size_s_m;
    const float share = along * cover(d, -reach.right_m, reach.left_m, pixel.edge_d_m);
    if (share > 0.0F) {
      const Sleeper& one = sleeper(s);
      const float spread = pixel.size_s_m < 0.5F ? one.grey : 1.0F;
      const float concrete =
          spread * tiles_.concrete.mean(s - one.begin_m + one.tile_s, d + one.tile_d, pixel.size_s_m, pixel.size_d_m);
      albedo += share * (concrete - albedo);
    }
  }
  return balises_.empty() ? albedo : balises(pixel, albedo);
}

float GroundShader::head_cover(const GroundPixel& pixel) {
  const float d = std::abs(pixel.at.d_m);
  return cover(d, kHalfGaugeM, kHalfGaugeM + kHeadWidthM, pixel.edge_d_m);
}

float GroundShader::head(const GroundPixel& pixel) const {
  const float position = pixel.at.s_m + rail_phase_m_;
  const int index = std::clamp(static_cast<int>(position), 0, static_cast<int>(rail_grey_.size()) - 2);
  const float w = position - static_cast<float>(index);
  const float shine = rail_grey_[static_cast<size_t>(index)] +
                      w * (rail_grey_[static_cast<size_t>(index) + 1] - rail_grey_[static_cast<size_t>(index)]);
  const float d = std::abs(pixel.at.d_m);
  const float band = cover(d, 0.0F, kHalfGaugeM + 0.056F, std::max(pixel.edge_d_m, 0.01F));
  return shine * (0.42F + 0.43F * band);
}

}  // namespace railfix::simulator
