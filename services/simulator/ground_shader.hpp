// What the ground shows at a place of the track: rails, sleepers, ballast, balises, verge, with exact coverage of
// edges.
#pragma once

#include <vector>

#include "simulator/line.hpp"
#include "simulator/local_track.hpp"
#include "simulator/renderer.hpp"
#include "simulator/texture.hpp"
#include "simulator/track_bed.hpp"

namespace railfix::simulator {

/// A pixel on the rail-head plane of a track.
struct GroundPixel {
  OnTrack at{};
  float slope_s = 0;  // metres along and left per metre that the ray sinks further
  float slope_d = 0;
  float size_s_m = 0;  // of the pixel on the ground, motion blur included in size_s_m
  float size_d_m = 0;
  float edge_d_m = 0;  // metres of d per pixel across an edge along the track
  uint32_t lane = 0;   // 0 = the own track; others have sleepers and stones of their own
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
  // The pixel in the counting of the map, and how far the sleepers reach there.
  struct Oriented {
    GroundPixel pixel;
    Reach reach;
  };
  struct Balise {
    float s, d;
    float albedo;
  };
  struct SleeperShare {
    float top, front;
  };
  [[nodiscard]] Oriented oriented(const GroundPixel& pixel, const Reach& reach) const;
  [[nodiscard]] float bed_depth(float d_m, float bay_m, const Reach& reach) const;
  [[nodiscard]] float bed(const GroundPixel& pixel, float bay_m, const Reach& reach) const;
  [[nodiscard]] float patchwork(const Tile& tile, float s_m, float d_m, const GroundPixel& pixel) const;
  [[nodiscard]] float sleepers_before(float s_m, float width_m, float shift_m) const;
  [[nodiscard]] SleeperShare sleeper_share(float s_m, float size_m, float hidden_m, bool seen_forward) const;
  [[nodiscard]] float ground_as_counted(const GroundPixel& pixel, const Reach& reach) const;
  [[nodiscard]] float sleepers(const GroundPixel& pixel, float bay_m, const Reach& reach, float below) const;
  [[nodiscard]] float sleeper_top(const Sleeper& one, float s_m, float d_m, const GroundPixel& pixel) const;
  [[nodiscard]] float marked(const GroundPixel& pixel, float s_m, float d_m, bool on_top, float below) const;
  [[nodiscard]] float balises(const GroundPixel& pixel, float below) const;

  Tiles tiles_;
  TrackBed bed_;
  bool forward_;
  bool flat_;  // one plane for sleepers and stones
  float sleeper_depth_m_;
  std::vector<Balise> balises_;
};

}  // namespace railfix::simulator
