#include "simulator/track_bed.hpp"

#include <algorithm>
#include <cmath>

#include "simulator/renderer.hpp"
#include "simulator/texture.hpp"

namespace railfix::simulator {
namespace {

constexpr double kBehindM = 60.0;  // of the tables; both are multiples of every cell
constexpr double kAheadM = 300.0;
constexpr int kPatchesAJoint = 8;
constexpr int64_t kSleepersAStretch = 300;  // of one kind, 180 m
constexpr int64_t kPatchesAStretch = 40;    // as oily, weedy and leafy
constexpr float kDeepestBayM = 0.08F;
constexpr float kTileM = 4.096F;

struct Phase {
  float phase_m;  // of the foot, from the table's beginning
  int64_t first;  // cell
};
Phase phase_of(const TexturePlace& place, double cell_m) {
  const double begin_m = place.forward ? kBehindM : kAheadM;
  const double index = std::floor(place.place_m / cell_m);
  return {static_cast<float>(place.place_m - index * cell_m + begin_m),
          static_cast<int64_t>(index) - std::llround(begin_m / cell_m)};
}
int64_t cells(double cell_m) {
  return static_cast<int64_t>((kBehindM + kAheadM) / cell_m);
}

int64_t stretch_of(int64_t cell, int64_t length) {
  return (cell >= 0 ? cell : cell - length + 1) / length;
}

// Numbers of one cell, one after the other.
class Draw {
 public:
  Draw(uint64_t seed, int64_t cell, int64_t purpose) : seed_(mix_bits(seed, cell, purpose)) {}
  float operator()() { return unit_float(mix_bits(seed_, ++count_)); }
  float between(float low, float high) { return low + (high - low) * (*this)(); }

 private:
  uint64_t seed_;
  int64_t count_ = 0;
};

Sleeper::Kind kind_of(int64_t sleeper, uint64_t seed) {
  const float draw = Draw(seed, stretch_of(sleeper, kSleepersAStretch), 11)();
  if (draw < 0.65F) return Sleeper::Kind::concrete;
  return draw < 0.88F ? Sleeper::Kind::wood : Sleeper::Kind::steel;
}

}  // namespace

TrackBed::TrackBed(const TexturePlace& place, uint64_t seed, double mean_bay_m) {
  const auto sleepers = phase_of(place, kSleeperPitchM);
  sleeper_phase_m_ = sleepers.phase_m;
  lay_sleepers(sleepers.first, seed, mean_bay_m);
  const auto patches = phase_of(place, static_cast<double>(kPatchM));
  patch_phase_m_ = patches.phase_m;
  lay_patches(patches.first, seed, mean_bay_m <= 0.0);
  ragged_phase_m_ = phase_of(place, static_cast<double>(kRaggedPeriodM)).phase_m;
  const auto shine = phase_of(place, 1.0);
  shine_phase_m_ = shine.phase_m;
  for (int64_t k = 0; k < cells(1.0); ++k)
    shine_.push_back(0.92F + 0.12F * unit_float(mix_bits(seed, shine.first + k, 4)));
}

void TrackBed::lay_sleepers(int64_t first, uint64_t seed, double mean_bay_m) {
  for (int64_t k = first; k < first + cells(kSleeperPitchM); ++k) {
    Draw draw(seed, k, 1);
    Sleeper one;
    one.kind = kind_of(k, seed);
    const float jitter = one.kind == Sleeper::Kind::wood ? 0.05F : 0.03F;
    one.middle_m = 0.5F * static_cast<float>(kSleeperPitchM) + jitter * (draw() - 0.5F);
    one.grey = draw.between(0.85F, 1.15F);
    one.tile_s = draw.between(0.0F, 2.0F);
    one.tile_d = draw.between(0.0F, 2.0F);
    // Mostly filled up to the tops, now and then deep.
    one.bay_m = std::min(kDeepestBayM, static_cast<float>(mean_bay_m) * -std::log(1.0F - draw()));
    sleepers_.push_back(one);
  }
}

void TrackBed::lay_patches(int64_t first, uint64_t seed, bool flat) {
  for (int64_t k = first; k < first + cells(static_cast<double>(kPatchM)); ++k) {
    Draw draw(seed, k, 3);
    Patch patch;
    patch.tile_s = draw.between(0.0F, kTileM);
    patch.tile_d = draw.between(0.0F, kTileM);
    patch.first_mark = static_cast<int>(marks_.size());
    patch.joint = (k % kPatchesAJoint + kPatchesAJoint) % kPatchesAJoint == 0;
    patches_.push_back(patch);
    if (!flat) add_marks(k, seed);
  }
}

void TrackBed::add_marks(int64_t patch, uint64_t seed) {
  Draw stretch(seed, stretch_of(patch, kPatchesAStretch), 21);
  const float oily = stretch();
  const float weedy = stretch() * stretch();
  const float leafy = stretch() < 0.35F ? stretch() : 0.0F;
  Draw draw(seed, patch, 22);
  const auto add = [&](Mark::Kind kind, float d, float half_s, float half_d, float strength) {
    marks_.push_back({kind, draw.between(half_s, kPatchM - half_s), d, half_s, half_d, strength});
  };
  if (draw() < 0.03F)
    add(Mark::Kind::puddle, draw.between(-0.3F, 0.3F), draw.between(0.3F, 0.9F), draw.between(0.15F, 0.4F), 1.0F);
  if (draw() < 0.5F * weedy)
    add(Mark::Kind::weed, (draw() < 0.5F ? -1.0F : 1.0F) * draw.between(0.9F, 2.3F), draw.between(0.08F, 0.35F),
        draw.between(0.08F, 0.3F), draw.between(0.5F, 1.0F));
  if (draw() < 0.6F * oily)
    add(Mark::Kind::oil, draw.between(-0.2F, 0.2F), draw.between(0.2F, 1.1F), draw.between(0.1F, 0.32F),
        draw.between(0.25F, 0.6F));
  for (int i = 0; i < static_cast<int>(5.0F * leafy); ++i)
    add(Mark::Kind::leaf, draw.between(-1.2F, 1.2F), draw.between(0.02F, 0.05F), draw.between(0.02F, 0.05F),
        draw.between(0.3F, 1.0F));
}

float TrackBed::shine(float s_m) const {
  const float position = s_m + shine_phase_m_;
  const int index = std::clamp(static_cast<int>(position), 0, static_cast<int>(shine_.size()) - 2);
  const float w = position - static_cast<float>(index);
  const auto at = static_cast<size_t>(index);
  return shine_[at] + w * (shine_[at + 1] - shine_[at]);
}

}  // namespace railfix::simulator
