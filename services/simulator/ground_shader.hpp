// What the ground shows at a place of the track: rails, sleepers, ballast, balises, verge, with exact coverage of
// edges.
#pragma once

#include <vector>

#include "simulator/line.hpp"
#include "simulator/local_track.hpp"
#include "simulator/renderer.hpp"
#include "simulator/texture.hpp"

namespace railfix::simulator {

/// A pixel on the rail-head plane of a track.
struct GroundPixel {
  OnTrack at{};
  float slope_s = 0;  // metres along and left per metre that the ray sinks further
  float slope_d = 0;
  float size_s_m = 0;  // of the pixel on the ground, motion blur included in size_s_m
  float size_d_m = 0;
  float edge_d_m = 0;  // metres of d per pixel across an edge along the track
};

class GroundShader {
 public:
  struct Tiles {
    const Tile& ballast;
    const Tile& concrete;
    const Tile& verge;
  };
  /// How far the sleepers reach from the track's middle; longer in switches.
  struct Reach {
    float left_m = 1.3F;
    float right_m = 1.3F;
  };
  GroundShader(const Line& line, const RenderOptions& options, const Tiles& tiles, double distance_m);

  /// Albedo (0..1) of ballast, sleepers, verge and balises.
  [[nodiscard]] float ground(const GroundPixel& pixel, const Reach& reach) const;
  /// Foot and web of a track's rails over what is below.
  [[nodiscard]] static float foot_and_web(const GroundPixel& pixel, float below);
  /// Share of the pixel that a rail head covers, for one track.
  [[nodiscard]] static float head_cover(const GroundPixel& pixel);
  /// Albedo of a rail head there.
  [[nodiscard]] float head(const GroundPixel& pixel) const;

 private:
  struct Sleeper {
    float begin_m;   // of its cell, from the foot
    float middle_m;  // within its cell
    float grey;
    float tile_s, tile_d;
  };
  struct Patch {
    float s, d;
  };
  [[nodiscard]] float patchwork(const Tile& tile, float s_m, float d_m, const GroundPixel& pixel) const;
  [[nodiscard]] const Sleeper& sleeper(float s_m) const;
  [[nodiscard]] float sleepers_before(float s_m) const;
  [[nodiscard]] float balises(const GroundPixel& pixel, float below) const;

  Tiles tiles_;
  float sleeper_depth_m_;
  float ballast_depth_m_;
  float sleeper_phase_m_ = 0;  // foot within its sleeper cell
  float patch_phase_m_ = 0;    // foot within its ballast patch
  float ragged_phase_m_ = 0;
  std::vector<Sleeper> sleepers_;
  std::vector<Patch> patches_;
  std::vector<float> rail_grey_;  // slow changes of the heads' shine, one a metre
  float rail_phase_m_ = 0;
  std::vector<Spot> balises_;  // s relative to the foot
};

}  // namespace railfix::simulator
