#include "simulator/ground_shader.hpp"

#include <algorithm>
#include <cmath>

namespace railfix::simulator {
namespace {

constexpr float kSleeperWidthM = 0.27F;
constexpr float kPatchBlend = 0.2F;
constexpr float kRailMiddleM = kHalfGaugeM + 0.5F * kHeadWidthM;
constexpr float kFarSideM = 9.0F;
constexpr float kRailsEndM = 1.5F;  // nothing of the rails further out
constexpr float kHalfFootM = 0.075F;
constexpr float kBaliseHalfLengthM = 0.18F;
constexpr float kBaliseHalfWidthM = 0.24F;
constexpr float kBaliseDepthM = 0.12F;
constexpr float kBallastEdgeM = 2.2F;
constexpr float kShoulderM = 0.45F;  // of the ballast beyond the sleepers' ends
constexpr float kSlopeM = 0.5F;
constexpr float kSleeperFront = 0.26F;
constexpr float kFastening = 0.17F;
constexpr float kWeed = 0.30F;
constexpr float kSkyInWater = 0.85F;
constexpr float kJointM = 0.004F;
constexpr float kShortFrontM = 0.12F;  // front faces of sleepers that stay within their cell
constexpr float kLaneShiftM = 4.8F;    // other tracks show other places of the textures
constexpr uint32_t kLanes = 5;
constexpr float kRagged = 6.2831853F / TrackBed::kRaggedPeriodM;

// Share of an interval of `size` around x that lies in [low, high].
float cover(float x, float low, float high, float size) {
  const float a = std::max(low, x - 0.5F * size);
  const float b = std::min(high, x + 0.5F * size);
  return b > a ? (b - a) / size : 0.0F;
}

double mean_bay_m(const RenderOptions& options) {
  return std::max(0.0, options.ballast_depth_m - options.texture_depth_m);
}

}  // namespace

GroundShader::GroundShader(const Line& line, const RenderOptions& options, const Tiles& tiles, double distance_m)
    : tiles_(tiles),
      bed_(line.texture_place(distance_m), options.seed, mean_bay_m(options)),
      forward_(line.texture_place(distance_m).forward),
      flat_(mean_bay_m(options) <= 0.0),
      sleeper_depth_m_(static_cast<float>(options.texture_depth_m)) {
  const float sign = forward_ ? 1.0F : -1.0F;
  for (const auto& balise : line.balises()) {
    if (std::abs(balise.distance_m - distance_m) > 120.0) continue;
    const auto place = std::llround(line.texture_place(balise.distance_m).place_m);
    balises_.push_back({sign * static_cast<float>(balise.distance_m - distance_m),
                        sign * static_cast<float>(balise.lateral_m),
                        0.58F + 0.12F * unit_float(mix_bits(options.seed, place, 31))});
  }
}

GroundShader::Oriented GroundShader::oriented(const GroundPixel& pixel, const Reach& reach) const {
  Oriented turned{pixel, reach};
  auto& out = turned.pixel;
  if (!forward_) {
    out.at.s_m = -out.at.s_m;
    out.at.d_m = -out.at.d_m;
    out.slope_s = -out.slope_s;
    out.slope_d = -out.slope_d;
    std::swap(turned.reach.left_m, turned.reach.right_m);
  }
  out.at.s_m += kLaneShiftM * static_cast<float>(pixel.lane % kLanes);
  return turned;
}

// Patches of a tile at random offsets, cross-faded at their borders: no repetition along the line.
float GroundShader::patchwork(const Tile& tile, float s_m, float d_m, const GroundPixel& pixel) const {
  const float position = bed_.patch_position(s_m);
  const int index = bed_.patch_index(position);
  const float local = position - static_cast<float>(index) * TrackBed::kPatchM;
  const auto at = [&](int i, float from_begin) {
    const Patch& patch = bed_.patch(i);
    return tile.mean(from_begin + patch.tile_s, d_m + patch.tile_d, pixel.size_s_m, pixel.size_d_m);
  };
  const float here = at(index, local);
  const float within = local * (1.0F / TrackBed::kPatchM);
  if (within < 1.0F - kPatchBlend) return here;
  const float w = std::min(1.0F, (within - (1.0F - kPatchBlend)) * (1.0F / kPatchBlend));
  return here + w * (at(index + 1, local - TrackBed::kPatchM) - here);
}

// Metres of sleeper between the table's beginning and s: its differences are exact means over any length. The
// sleepers may be taken wider than they are, and moved.
float GroundShader::sleepers_before(float s_m, float width_m, float shift_m) const {
  constexpr auto kPitch = static_cast<float>(kSleeperPitchM);
  const float position = bed_.sleeper_position(s_m) - shift_m;
  const int index = static_cast<int>(position * (1.0F / kPitch));
  const float begin = static_cast<float>(index) * kPitch + bed_.sleeper(index).middle_m - 0.5F * width_m;
  return static_cast<float>(index) * width_m + std::clamp(position - begin, 0.0F, width_m);
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
    const float ds = s - balise.s;
    const float dd = d - balise.d;
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
    albedo += plate * (balise.albedo + 0.08F + 0.08F * field - albedo);
  }
  return albedo;
}

// Depth of the stones below the rail heads: in the bays between sleepers, heaped at their ends, falling to the verge.
float GroundShader::bed_depth(float d_m, float bay_m, const Reach& reach) const {
  if (flat_) return sleeper_depth_m_;
  const float out = d_m > 0.0F ? d_m - reach.left_m : -d_m - reach.right_m;  // beyond the sleepers' ends
  if (out < -0.1F) return sleeper_depth_m_ + bay_m;
  if (out < 0.1F) return sleeper_depth_m_ + bay_m * (0.1F - out) * 5.0F;
  const float fall = std::clamp((out - kShoulderM) * (1.0F / kSlopeM), 0.0F, 1.0F);
  return sleeper_depth_m_ + static_cast<float>(kVergeDropM) * fall;
}

float GroundShader::bed(const GroundPixel& pixel, float bay_m, const Reach& reach) const {
  float depth = sleeper_depth_m_ + bay_m;
  const float on_bay = pixel.at.d_m + pixel.slope_d * depth;
  if (on_bay > reach.left_m - 0.1F || on_bay < 0.1F - reach.right_m) {
    for (int i = 0; i < 3; ++i) depth = bed_depth(pixel.at.d_m + pixel.slope_d * depth, bay_m, reach);
  }
  const float s = pixel.at.s_m + pixel.slope_s * depth;
  const float d = pixel.at.d_m + pixel.slope_d * depth;
  const float edge = kBallastEdgeM - 1.3F + (d > 0.0F ? reach.left_m : reach.right_m);
  float beside = std::abs(d) > edge ? 1.0F : 0.0F;
  if (std::abs(std::abs(d) - edge) < 0.7F) {
    const float phase = (s + bed_.ragged_phase_m()) * kRagged;
    const float ragged = 0.25F * std::sin(phase) * std::sin(phase * 4.0F);
    beside = std::clamp((std::abs(d) - edge - ragged) * 2.5F, 0.0F, 1.0F);
  }
  float albedo = beside < 1.0F ? patchwork(tiles_.ballast, s, d, pixel) : 0.0F;
  // Deep bays get less light.
  albedo *= 1.0F - 3.0F * std::clamp(depth - sleeper_depth_m_ - 0.02F, 0.0F, 0.06F);
  if (beside > 0.0F) albedo += beside * (patchwork(tiles_.verge, s, d, pixel) - albedo);
  return marked(pixel, s, d, false, albedo);
}

float GroundShader::sleeper_top(const Sleeper& one, float s_m, float d_m, const GroundPixel& pixel) const {
  const float grey = pixel.size_s_m < 0.5F ? one.grey : 1.0F;
  const auto texture = [&](float s, float d) {
    return tiles_.concrete.mean(s + one.tile_s, d + one.tile_d, pixel.size_s_m, pixel.size_d_m);
  };
  if (one.kind == Sleeper::Kind::concrete) return grey * texture(s_m, d_m);
  // Wood has its grain along the sleeper; steel is plain and rusty.
  if (one.kind == Sleeper::Kind::wood) return grey * (0.30F + 1.2F * (texture(3.0F * s_m, 0.4F * d_m) - 0.56F));
  return grey * (0.25F + 0.5F * (texture(s_m, d_m) - 0.56F));
}

// Shares of tops and front faces along the track within the pixel.
GroundShader::SleeperShare GroundShader::sleeper_share(float s_m, float size_m, float hidden_m,
                                                       bool seen_forward) const {
  constexpr auto kPitch = static_cast<float>(kSleeperPitchM);
  const float half = 0.5F * size_m;
  const float position = bed_.sleeper_position(s_m);
  const int index = static_cast<int>(position * (1.0F / kPitch));
  const float within = position - static_cast<float>(index) * kPitch;
  if (within > half && within + half < kPitch && hidden_m < kShortFrontM) {
    // All in one cell.
    const float begin = bed_.sleeper(index).middle_m - 0.5F * kSleeperWidthM;
    const float face = seen_forward ? begin - hidden_m : begin + kSleeperWidthM;
    return {cover(within, begin, begin + kSleeperWidthM, size_m), cover(within, face, face + hidden_m, size_m)};
  }
  const auto along = [&](float width, float shift) {
    return (sleepers_before(s_m + half, width, shift) - sleepers_before(s_m - half, width, shift)) / size_m;
  };
  const float top = along(kSleeperWidthM, 0.0F);
  if (hidden_m <= 0.0F) return {top, 0.0F};
  return {top, std::max(0.0F, along(kSleeperWidthM + hidden_m, (seen_forward ? -0.5F : 0.5F) * hidden_m) - top)};
}

// Tops, front faces down to the stones, fastenings.
float GroundShader::sleepers(const GroundPixel& pixel, float bay_m, const Reach& reach, float below) const {
  const float s = pixel.at.s_m + pixel.slope_s * sleeper_depth_m_;
  const float d = pixel.at.d_m + pixel.slope_d * sleeper_depth_m_;
  if (d > reach.left_m + 0.2F || d < -reach.right_m - 0.2F) return below;
  constexpr auto kPitch = static_cast<float>(kSleeperPitchM);
  const float hidden = std::min(std::abs(pixel.slope_s) * bay_m, kPitch - 0.06F - kSleeperWidthM);
  const auto share = sleeper_share(s, pixel.size_s_m, hidden, pixel.slope_s > 0.0F);
  const float across = cover(d, -reach.right_m, reach.left_m, pixel.edge_d_m);
  float albedo = below;
  if (share.front > 0.0F && share.top < 1.0F) {
    albedo += across * std::min(1.0F, share.front / (1.0F - share.top)) * (kSleeperFront - albedo);
  }
  if (share.top * across <= 0.0F) return albedo;
  const float position = bed_.sleeper_position(s);
  const int index = static_cast<int>(position * (1.0F / kPitch));
  const Sleeper& one = bed_.sleeper(index);
  const float within = position - static_cast<float>(index) * kPitch;
  float top = sleeper_top(one, within, d, pixel);
  const float from_rail = std::abs(std::abs(d) - kRailMiddleM);
  if (from_rail < 0.22F && pixel.size_s_m < 0.4F) {
    const bool plate = one.kind == Sleeper::Kind::wood;
    const float length = plate ? 0.16F : 0.10F;
    const float clip = cover(from_rail, 0.075F, plate ? 0.18F : 0.15F, pixel.edge_d_m) *
                       cover(within, one.middle_m - 0.5F * length, one.middle_m + 0.5F * length, pixel.size_s_m);
    top += clip * (kFastening - top);
  }
  return albedo + share.top * across * (top - albedo);
}

// Stains and puddles, weeds and leaves: on the stones, or on all that lies there.
float GroundShader::marked(const GroundPixel& pixel, float s_m, float d_m, bool on_top, float below) const {
  const float position = bed_.patch_position(s_m);
  const int index = bed_.patch_index(position);
  const float local = position - static_cast<float>(index) * TrackBed::kPatchM;
  float albedo = below;
  for (int i = bed_.patch(index).first_mark; i < bed_.patch(index + 1).first_mark; ++i) {
    const Mark& mark = bed_.marks()[static_cast<size_t>(i)];
    if (on_top != (mark.kind == Mark::Kind::oil || mark.kind == Mark::Kind::leaf)) continue;
    const float half_s = mark.half_s + 0.3F * pixel.size_s_m;
    const float half_d = mark.half_d + 0.3F * pixel.size_d_m;
    if (std::abs(d_m - mark.d) > half_d || std::abs(local - mark.s) > half_s) continue;
    const float a = (local - mark.s) / half_s;
    const float b = (d_m - mark.d) / half_d;
    const float inside = 1.0F - a * a - b * b;
    if (inside <= 0.0F) continue;
    switch (mark.kind) {
      case Mark::Kind::oil:
        albedo *= 1.0F - mark.strength * std::min(1.0F, 1.6F * inside);
        break;
      case Mark::Kind::puddle: {
        // Water mirrors the sky, the more the flatter one looks (Schlick).
        const float flat = 1.0F - 1.0F / std::sqrt(1.0F + pixel.slope_s * pixel.slope_s);
        const float mirror = 0.04F + 0.96F * flat * flat * flat;
        const float wet = std::min(1.0F, 6.0F * inside);
        albedo += wet * (0.5F * albedo * (1.0F - mirror) + kSkyInWater * mirror - albedo);
        break;
      }
      case Mark::Kind::weed:
        albedo += mark.strength * std::min(1.0F, 2.0F * inside) * (kWeed * (0.6F + albedo) - albedo);
        break;
      case Mark::Kind::leaf:
        albedo += std::min(1.0F, 4.0F * inside * mark.half_s / (mark.half_s + 0.3F * pixel.size_s_m)) *
                  (0.15F + 0.5F * mark.strength - albedo);
        break;
    }
  }
  return albedo;
}

float GroundShader::ground(const GroundPixel& seen, const Reach& reach_along_path) const {
  if (!forward_ || seen.lane != 0) {
    const auto turned = oriented(seen, reach_along_path);
    return ground_as_counted(turned.pixel, turned.reach);
  }
  return ground_as_counted(seen, reach_along_path);
}

float GroundShader::ground_as_counted(const GroundPixel& pixel, const Reach& reach) const {
  const float s = pixel.at.s_m + pixel.slope_s * sleeper_depth_m_;
  float bay_m = 0.0F;
  if (!flat_) {
    constexpr auto kPitch = static_cast<float>(kSleeperPitchM);
    const float position = bed_.sleeper_position(s);
    const int index = static_cast<int>(position * (1.0F / kPitch));
    const bool before = position - static_cast<float>(index) * kPitch < bed_.sleeper(index).middle_m;
    bay_m = bed_.sleeper(before ? index - 1 : index).bay_m;
  }
  float albedo = sleepers(pixel, bay_m, reach, bed(pixel, bay_m, reach));
  albedo = marked(pixel, s, pixel.at.d_m + pixel.slope_d * sleeper_depth_m_, true, albedo);
  return balises_.empty() || pixel.lane != 0 ? albedo : balises(pixel, albedo);
}

float GroundShader::head_cover(const GroundPixel& pixel) {
  const float d = std::abs(pixel.at.d_m);
  return cover(d, kHalfGaugeM, kHalfGaugeM + kHeadWidthM, pixel.edge_d_m);
}

float GroundShader::head(const GroundPixel& pixel) const {
  const float s = (forward_ ? pixel.at.s_m : -pixel.at.s_m) + kLaneShiftM * static_cast<float>(pixel.lane % kLanes);
  const float shine = bed_.shine(s);
  const float d = std::abs(pixel.at.d_m);
  const float band = cover(d, 0.0F, kHalfGaugeM + 0.056F, std::max(pixel.edge_d_m, 0.01F));
  float albedo = shine * (0.42F + 0.43F * band);
  const float position = bed_.patch_position(s);
  const int index = bed_.patch_index(position);
  if (bed_.patch(index).joint) {
    const float local = position - static_cast<float>(index) * TrackBed::kPatchM - 0.5F;
    albedo += cover(local, -kJointM, kJointM, pixel.size_s_m) * (0.08F - albedo);
  }
  return albedo;
}

}  // namespace railfix::simulator
