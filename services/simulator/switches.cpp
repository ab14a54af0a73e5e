#include "simulator/switches.hpp"

#include <algorithm>
#include <cmath>

namespace railfix::simulator {
namespace {

constexpr float kGaugeM = 2.0F * kHalfGaugeM;
constexpr float kOuterFaceM = kHalfGaugeM + kHeadWidthM;
constexpr float kFlangewayM = 0.045F;
constexpr float kTipM = 0.004F;        // blades begin where the tracks are so far apart
constexpr float kHeelM = 0.16F;        // and are as far from the stock rail as they stay from here
constexpr float kOpenM = 0.12F;        // opening of a blade at its tip
constexpr float kNoseM = 0.012F;       // width of the frog's blunt nose
constexpr float kWingM = 0.13F;        // tracks' way apart while wing rails run beside the nose
constexpr float kCheckM = 0.22F;       // the same for check rails, before and behind the frog
constexpr float kCheckFlareM = 0.05F;  // their ends turn away
constexpr float kCheckHeadM = 0.05F;
constexpr float kNearM = 1.8F;  // tracks further apart have rails of their own
constexpr float kNone = 1e9F;

float cover(float x, float low, float high, float size) {
  const float a = std::max(low, x - 0.5F * size);
  const float b = std::min(high, x + 0.5F * size);
  return b > a ? (b - a) / size : 0.0F;
}

/// The nearest track on one side of a track.
struct Neighbour {
  float apart_m = kNone;
  bool first = false;  // its heads go before, and the switch lies for it
};
Neighbour neighbour(std::span<const GroundPixel* const> tracks, size_t track, float side) {
  Neighbour nearest;
  for (size_t i = 0; i < tracks.size(); ++i) {
    if (i == track) continue;
    const float apart_m = side * (tracks[track]->at.d_m - tracks[i]->at.d_m);
    const bool beside = apart_m > 0.0F || (apart_m == 0.0F && i < track);
    if (beside && apart_m < std::min(nearest.apart_m, kNearM)) nearest = {apart_m, i < track};
  }
  return nearest;
}

// The rail towards the neighbour; e grows from the track's middle towards it.
float inner_rail(float e, float size, const Neighbour& other) {
  const float apart = other.apart_m;
  if (other.first && apart < kHeelM) {
    if (apart < kTipM) return 0.0F;
    const float open = kOpenM * (1.0F - apart / kHeelM);
    return cover(e, kHalfGaugeM - open, kHalfGaugeM + std::min(apart, kHeadWidthM) - open, size);
  }
  const float past = apart - kGaugeM;
  if (past < -kFlangewayM) return cover(e, kHalfGaugeM, kOuterFaceM, size);
  float share = 0.0F;
  if (past < kWingM) {
    const float face = kHalfGaugeM + past + kFlangewayM;
    share = cover(e, face, face + kHeadWidthM, size);
  }
  // The nose is one piece; of the two rails in it the first one's head is drawn whole.
  const float nose = other.first ? past - kHeadWidthM : past;
  if (past > kNoseM && nose > 0.0F) share += cover(e, kHalfGaugeM, kHalfGaugeM + std::min(kHeadWidthM, nose), size);
  return std::min(share, 1.0F);
}

// The rail away from the neighbour; a closed blade that lies on it hides part of it.
float outer_rail(float e, float size, const Neighbour& opposite) {
  const float blade = opposite.first ? std::max(0.0F, kHeadWidthM - opposite.apart_m) : 0.0F;
  return blade < kHeadWidthM ? cover(e, kHalfGaugeM + blade, kOuterFaceM, size) : 0.0F;
}

float check_rail(float e, float size, const Neighbour& opposite) {
  const float past = std::abs(opposite.apart_m - kGaugeM);
  if (past > kCheckM) return 0.0F;
  const float flare = std::max(0.0F, past - (kCheckM - kCheckFlareM));
  const float face = kHalfGaugeM - kFlangewayM - flare;
  return cover(e, face - kCheckHeadM, face, size);
}

}  // namespace

HeadShare head_share(std::span<const GroundPixel* const> tracks, size_t track) {
  const GroundPixel& pixel = *tracks[track];
  const float side = pixel.at.d_m > 0.0F ? 1.0F : -1.0F;
  const float e = side * pixel.at.d_m;
  const float size = pixel.edge_d_m;
  if (e + size < kHalfGaugeM - kOpenM - kCheckHeadM || e - size > kOuterFaceM + kWingM + kFlangewayM) return {};
  const Neighbour inner = neighbour(tracks, track, side);
  const Neighbour opposite = neighbour(tracks, track, -side);
  return {inner.apart_m < kNearM ? inner_rail(e, size, inner) : outer_rail(e, size, opposite),
          check_rail(e, size, opposite)};
}

bool frog_plate(std::span<const GroundPixel* const> tracks, size_t track) {
  const float d = tracks[track]->at.d_m;
  const float side = d > 0.0F ? 1.0F : -1.0F;
  const float past = neighbour(tracks, track, side).apart_m - kGaugeM;
  if (past < -0.09F || past > kWingM + 0.03F) return false;
  const float e = side * d;
  return e > kHalfGaugeM - kFlangewayM - kHeadWidthM && e < kOuterFaceM + kFlangewayM + std::max(0.0F, past);
}

bool foot_shows(std::span<const GroundPixel* const> tracks, size_t track) {
  const float side = tracks[track]->at.d_m > 0.0F ? 1.0F : -1.0F;
  const auto inner = neighbour(tracks, track, side);
  return !(inner.first && inner.apart_m < kHeadWidthM);
}

}  // namespace railfix::simulator
