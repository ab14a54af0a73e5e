// The virtual train's line as the renderer needs it: the path's centre line on a fixed grid, the tracks beside it and
// what stands along it.
#pragma once

#include <memory>
#include <vector>

#include "core/result.hpp"
#include "track/path.hpp"

namespace railfix::simulator {

constexpr double kRailSpacingM = 1.507;  // between the rail heads' middles, the base of the cant
constexpr double kCentreStepM = 0.25;    // chord error at R = 300 m: 0.03 mm

/// One place of a centre line in map coordinates.
struct CentreSample {
  track::PlanPose pose;
  double elevation_m = 0;
  double curvature_per_m = 0;
  double cant_m = 0;
};

/// A centre line sampled every kCentreStepM from begin_m, in the direction and on the scale of the path.
struct CentreLine {
  double begin_m = 0;
  std::vector<CentreSample> samples;
};

/// From begin to end along the path; lateral_m left positive (platforms: sign = side).
struct Span {
  double begin_m = 0;
  double end_m = 0;
  double lateral_m = 0;
};
struct Spot {
  double distance_m = 0;
  double lateral_m = 0;
};

/// Read-only after it is made; may be used from many threads.
class Line {
 public:
  /// The path from `start` over the straight way of every switch, at most `ahead_m` long. Fails when the path is
  /// shorter than 50 m.
  static core::Result<Line> make(std::shared_ptr<const track::Map> map, const track::EdgePosition& start,
                                 double ahead_m);

  [[nodiscard]] const track::Path& path() const { return path_; }
  [[nodiscard]] const CentreLine& main() const { return main_; }
  /// Tracks that leave or join the path at its switches.
  [[nodiscard]] const std::vector<CentreLine>& branches() const { return branches_; }
  [[nodiscard]] const std::vector<Spot>& balises() const { return balises_; }
  [[nodiscard]] const std::vector<Spot>& masts() const { return masts_; }
  [[nodiscard]] const std::vector<Spot>& bridges() const { return bridges_; }
  [[nodiscard]] const std::vector<Span>& tunnels() const { return tunnels_; }
  [[nodiscard]] const std::vector<Span>& platforms() const { return platforms_; }
  /// How deep inside a tunnel (0 outside, else metres to the nearer portal).
  [[nodiscard]] double depth_in_tunnel_m(double distance_m) const;

 private:
  explicit Line(track::Path path) : path_(std::move(path)) {}
  void sample_main();
  void sample_branches();
  void collect_objects();
  track::Path path_;
  CentreLine main_;
  std::vector<CentreLine> branches_;
  std::vector<Spot> balises_;
  std::vector<Spot> masts_;
  std::vector<Spot> bridges_;
  std::vector<Span> tunnels_;
  std::vector<Span> platforms_;
};

}  // namespace railfix::simulator
