// The virtual train's line as the renderer needs it: the path's centre line on a fixed grid, the tracks beside it and
// what stands along it.
#pragma once

#include <cstdint>
#include <memory>
#include <set>
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
  uint32_t edge = 0;  // of a track beside the path
};

/// From begin to end along the path; lateral_m left positive. A platform's edge is at lateral_m and its body lies
/// outward; a tunnel reaches from right_m to left_m.
struct Span {
  double begin_m = 0;
  double end_m = 0;
  double lateral_m = 0;
  double outward = 0;
  double left_m = 0;
  double right_m = 0;
};
struct Spot {
  double distance_m = 0;
  double lateral_m = 0;
};

/// A mast holds the wire of the track at track_m.
struct Mast {
  double distance_m = 0;
  double lateral_m = 0;
  double track_m = 0;
};
/// A road over the tracks; its near face, as seen along the path, is at distance_m, its abutments at left_m and
/// right_m.
struct Bridge {
  double distance_m = 0;
  double left_m = 0;
  double right_m = 0;
};

/// Something of the map beside the path, on the path's own scale.
struct Thing {
  track::LandmarkKind kind = track::LandmarkKind::unknown;  // as met along the path
  double distance_m = 0;
  double lateral_m = 0;
  bool own = true;       // on an edge of the path; else on a track beside it
  double outward = 0.0;  // sign of the side of its track that it stands on
};

/// What looks like a landmark and is none: signals, boards, posts.
struct Distractor {
  enum class Kind : uint8_t { signal, distance_board, speed_board, cabinet };
  Kind kind = Kind::signal;
  double distance_m = 0;
  double lateral_m = 0;
};

/// Where a place of the path is in a counting that does not depend on where the path begins and how it runs.
struct TexturePlace {
  double place_m = 0;
  bool forward = true;  // the path runs as that counting does
};

/// Over which edges a path runs there.
std::set<uint32_t> edges_between(const track::Path& path, double from_m, double to_m);

/// Read-only after it is made; may be used from many threads.
class Line {
 public:
  /// The path from `start` over the straight way of every switch or the edges of `via`, at most `ahead_m` long. Fails
  /// when the path is shorter than 50 m.
  static core::Result<Line> make(std::shared_ptr<const track::Map> map, const track::EdgePosition& start,
                                 double ahead_m, const std::vector<uint32_t>& via = {});

  [[nodiscard]] const track::Path& path() const { return path_; }
  [[nodiscard]] const CentreLine& main() const { return main_; }
  /// Tracks that leave, join or accompany the path.
  [[nodiscard]] const std::vector<CentreLine>& branches() const { return branches_; }
  /// Landmarks on the path, and of the tracks beside it those that are as good as beside the path.
  [[nodiscard]] const std::vector<Thing>& things() const { return things_; }
  [[nodiscard]] const std::vector<Spot>& balises() const { return balises_; }
  [[nodiscard]] const std::vector<Mast>& masts() const { return masts_; }
  [[nodiscard]] const std::vector<Bridge>& bridges() const { return bridges_; }
  [[nodiscard]] const std::vector<Span>& tunnels() const { return tunnels_; }
  [[nodiscard]] const std::vector<Span>& platforms() const { return platforms_; }
  [[nodiscard]] const std::vector<Distractor>& distractors() const { return distractors_; }
  /// Lateral offsets of the tracks beside the path at a place, the path's own (0) first.
  [[nodiscard]] std::vector<double> tracks_at(double distance_m) const;
  [[nodiscard]] TexturePlace texture_place(double distance_m) const {
    return {counted_from_m_ + (counted_forward_ ? distance_m : -distance_m), counted_forward_};
  }
  /// How deep inside a tunnel (0 outside, else metres to the nearer portal).
  [[nodiscard]] double depth_in_tunnel_m(double distance_m) const;

 private:
  explicit Line(track::Path path) : path_(std::move(path)) {}
  void sample_main();
  void sample_branches();
  void collect_things();
  void collect_objects();
  void place_distractors();
  [[nodiscard]] Spot spot_of(double easting_m, double northing_m) const;
  /// Of the path.
  [[nodiscard]] const CentreSample& sample_at(double distance_m) const;
  track::Path path_;
  double counted_from_m_ = 0;
  bool counted_forward_ = true;
  bool begins_in_tunnel_ = false;
  CentreLine main_;
  std::vector<CentreLine> branches_;
  std::vector<Thing> things_;
  std::vector<Distractor> distractors_;
  std::vector<Spot> balises_;
  std::vector<Mast> masts_;
  std::vector<Bridge> bridges_;
  std::vector<Span> tunnels_;
  std::vector<Span> platforms_;
};

}  // namespace railfix::simulator
