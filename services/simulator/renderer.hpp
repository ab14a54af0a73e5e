// Cab pictures by casting a ray per pixel on the track's surface; rail edges are exact to a few thousandths of a pixel.
#pragma once

#include <cstdint>
#include <memory>
#include <opencv2/core.hpp>
#include <vector>

#include "geometry/camera.hpp"
#include "simulator/line.hpp"
#include "simulator/local_track.hpp"
#include "simulator/look.hpp"
#include "simulator/shadow_field.hpp"
#include "simulator/texture.hpp"
#include "simulator/windscreen.hpp"

namespace railfix::simulator {

constexpr float kHalfGaugeM = 0.7175F;  // inner edges of the rail heads from the track centre
constexpr float kHeadWidthM = 0.072F;   // 60E1
constexpr float kRailFootDepthM = 0.150F;
constexpr double kSleeperPitchM = 0.60;
constexpr double kVergeDropM = 0.30;  // ground beside the ballast, below the sleeper tops

/// The part of the picture that is drawn: own track so far ahead and so far to both sides; the rest is grey.
struct Strip {
  double ahead_m = 0;  // 0 = everything
  double beside_m = 1.2;
  double whole_before_m = 0;  // everything so far before a frog and before a tunnel, and in the tunnel
};

/// Shape of what Look gives the strength of.
struct WeatherOptions {
  ShadowShape shadows;
  GlassOptions glass;
};

/// A train on a track beside the path.
struct OtherTrain {
  uint32_t edge = 0;      // of the track beside
  double front_m = 0;     // of its leading end at the beginning of the run, on the path's scale
  double speed_mps = 0;   // against the path = negative
  double length_m = 100;  // rounded to whole cars
};

struct RenderOptions {
  geometry::Intrinsics camera;
  double texture_depth_m = 0.18;  // sleeper tops below the rail heads
  double ballast_depth_m = 0.20;  // mean of the stones between sleepers; the same as the sleepers = all flat
  double read_noise_grey = 1.2;   // 1 sigma in the dark
  double shot_noise_grey = 0.18;  // variance per grey level
  double vignetting = 0.18;       // loss of light in the corners
  bool scenery = true;            // masts, platforms, tunnels, bridges
  std::vector<OtherTrain> trains;
  Strip strip;
  WeatherOptions weather;
  uint64_t seed = 1;
};

/// What changes from picture to picture.
struct Shot {
  geometry::CameraPose pose;  // absolute, against the track
  double distance_m = 0;      // of the camera's foot on the path
  double speed_mps = 0;
  double exposure_s = 0.002;
  double gain = 1.0;  // brightness factor (auto-exposure and its wander)
  uint64_t noise_seed = 0;
  Look look;
};

class Illumination;
struct InTheAir;

/// Read-only after it is made: render() may be called from many threads.
class Renderer {
 public:
  Renderer(std::shared_ptr<const Line> line, const RenderOptions& options);
  /// CV_8UC1 of the camera's size.
  [[nodiscard]] cv::Mat render(const Shot& shot) const;
  /// Share of the own rails within 25 m and in the picture that stand out against what lies beside them: not dark,
  /// not washed out, nothing on the windscreen before them.
  [[nodiscard]] double rails_visible(const Shot& shot) const;
  [[nodiscard]] const RenderOptions& options() const { return options_; }

  struct Columns {
    int begin, end;
  };

 private:
  [[nodiscard]] bool draws_all(double distance_m) const;
  [[nodiscard]] std::vector<Columns> drawn_spans(const LocalTrack& main, const Shot& shot) const;  // of each row
  void weather(const Shot& shot, double heading_rad, const Illumination& light, cv::Mat& radiance) const;
  [[nodiscard]] InTheAir air(const Shot& shot, double heading_rad) const;
  [[nodiscard]] cv::Mat expose(const cv::Mat& radiance, const std::vector<Columns>& spans, const Shot& shot) const;
  std::shared_ptr<const Line> line_;
  RenderOptions options_;
  ShadowField shadows_;
  Windscreen windscreen_;
  Tile ballast_;
  Tile concrete_;
  Tile verge_;
  std::vector<float> normal_x_;  // undistorted x/z and y/z of every pixel
  std::vector<float> normal_y_;
  std::vector<float> vignette_;
  std::vector<float> noise_;  // standard normal numbers
};

}  // namespace railfix::simulator
