// Weather, light and camera of a virtual run: what may be chosen, and what it comes to at a moment.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/result.hpp"
#include "geometry/camera.hpp"
#include "simulator/look.hpp"
#include "simulator/renderer.hpp"
#include "simulator/trajectory.hpp"

namespace railfix::simulator {

struct LightOptions {
  double sky = 1.0;
  double dome = 1.0;
  double sun = 0.0;
  double sun_elevation_deg = 35.0;
  double sun_heading_deg = 63.0;
  std::string sun_when = "always";
  double headlamp = 1.0;
  double haze_m = 500.0;
};
struct ShadowOptions {
  double depth = 0.0;
  std::string when = "always";
};
struct RainOptions {
  double intensity = 0.0;
  double wet = 0.0;
  std::string when = "always";
};
struct LeafOptions {
  double intensity = 0.0;
  std::string when = "always";
};
struct WindscreenOptions {
  double drops = 0.0;
  std::string drops_when = "always";
  double dirt = 0.0;
  std::string wiper_when = "never";
};
struct ExposureOptions {
  double time_s = 0.002;
  double adapt_s = 0.4;
  double step = 0.0;
  double most_gain = 4.0;
  double wander = 0.05;
};
struct FrameOptions {
  double drop_share = 0.0;
  int64_t drop_run = 1;
  std::string drop_when = "always";
  double jitter_s = 0.0;
};

struct ScenarioOptions {
  LightOptions light;
  ShadowOptions shadows;
  RainOptions rain;
  LeafOptions leaves;
  WindscreenOptions windscreen;
  ExposureOptions exposure;
  FrameOptions frames;
};

/// When something is there: "always", "never", or stretches of time or way "10..20 s, 300..450 m".
class When {
 public:
  /// Fails with what is wrong with the text.
  static core::Result<When> parse(const std::string& text);
  /// 0 (not there) to 1 (there), over half a second or five metres at the ends of a stretch.
  [[nodiscard]] double strength(double time_s, double distance_m) const;

 private:
  struct Stretch {
    bool time;
    double begin, end;
  };
  bool always_ = false;
  std::vector<Stretch> stretches_;
};

/// One picture. What it shows is of exposed_ns; what it says about itself is stamp_ns.
struct Exposure {
  int64_t stamp_ns = 0;
  int64_t exposed_ns = 0;  // middle of the exposure
  bool dropped = false;    // the camera never hands it out
};

/// Read-only after it is made; may be used from many threads.
class Scenario {
 public:
  /// Fails when a `when` cannot be read, with its key.
  static core::Result<Scenario> make(const ScenarioOptions& options, uint64_t seed);

  [[nodiscard]] Look look(double time_s, double distance_m) const;
  /// Brightness factor of the camera: auto-exposure that follows the light ahead with a lag, and a slow wander.
  [[nodiscard]] double gain(const Trajectory& trajectory, double time_s) const;
  /// The pictures of a run; their place in the row is their sequence number.
  [[nodiscard]] std::vector<Exposure> exposures(const Trajectory& trajectory, double rate_hz) const;
  [[nodiscard]] const ScenarioOptions& options() const { return options_; }

 private:
  Scenario() = default;
  ScenarioOptions options_;
  uint64_t seed_ = 1;
  When sun_, shadows_, rain_, leaves_, drops_, wiper_, drop_frames_;
};

}  // namespace railfix::simulator
