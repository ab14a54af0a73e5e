// What lies along a track in one picture, worked out from the place on the map and the seed: sleepers, depth of the
// stones between them, stains, puddles, weeds, leaves, rail joints.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "simulator/line.hpp"

namespace railfix::simulator {

struct Sleeper {
  enum class Kind : uint8_t { concrete, wood, steel };
  float middle_m = 0;  // within its cell of kSleeperPitchM
  float grey = 1;
  float tile_s = 0, tile_d = 0;
  float bay_m = 0;  // stones behind it so far below its top
  Kind kind = Kind::concrete;
};

/// Ellipse on the ground, s from the beginning of its patch.
struct Mark {
  enum class Kind : uint8_t { oil, puddle, weed, leaf };
  Kind kind = Kind::oil;
  float s = 0, d = 0, half_s = 1, half_d = 1;
  float strength = 1;
};

struct Patch {
  float tile_s = 0, tile_d = 0;
  int first_mark = 0;  // in TrackBed::marks, up to the next patch's
  bool joint = false;  // the rails are joined at its beginning
};

/// s is metres from the camera's foot, growing with the map's own counting (not with the path's when it is run against
/// it).
class TrackBed {
 public:
  static constexpr float kPatchM = 2.4F;

  /// mean_bay_m = 0 makes it flat.
  TrackBed(const TexturePlace& place, uint64_t seed, double mean_bay_m);

  [[nodiscard]] const Sleeper& sleeper(int index) const {
    return sleepers_[static_cast<size_t>(std::clamp(index, 0, static_cast<int>(sleepers_.size()) - 1))];
  }
  [[nodiscard]] float sleeper_position(float s_m) const { return s_m + sleeper_phase_m_; }
  [[nodiscard]] float patch_position(float s_m) const { return s_m + patch_phase_m_; }
  [[nodiscard]] int patch_index(float position) const {
    return std::clamp(static_cast<int>(position * (1.0F / kPatchM)), 0, static_cast<int>(patches_.size()) - 2);
  }
  [[nodiscard]] const Patch& patch(int index) const { return patches_[static_cast<size_t>(index)]; }
  [[nodiscard]] const std::vector<Mark>& marks() const { return marks_; }
  /// Slow change of the rail heads' shine.
  [[nodiscard]] float shine(float s_m) const;
  /// Phase of the ragged edge of the ballast.
  [[nodiscard]] float ragged_phase_m() const { return ragged_phase_m_; }
  static constexpr float kRaggedPeriodM = 12.0F;

 private:
  void lay_sleepers(int64_t first, uint64_t seed, double mean_bay_m);
  void lay_patches(int64_t first, uint64_t seed, bool flat);
  void add_marks(int64_t patch, uint64_t seed);
  std::vector<Sleeper> sleepers_;
  std::vector<Patch> patches_;
  std::vector<Mark> marks_;
  std::vector<float> shine_;
  float sleeper_phase_m_ = 0;
  float patch_phase_m_ = 0;
  float ragged_phase_m_ = 0;
  float shine_phase_m_ = 0;
};

}  // namespace railfix::simulator
