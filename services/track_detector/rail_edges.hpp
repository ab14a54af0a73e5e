// Sub-pixel points of the inner edges of the rail heads, in the original picture, near where a first shape puts them.
#pragma once

#include <array>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "track_detector/rail_fit.hpp"

namespace railfix::track_detector {

struct EdgeOptions {
  double gauge_m = 1.435;
  double head_m = 0.07;
  double near_m = 5;
  double far_m = 50;
  int stations = 40;
  double reach_m = 0.1;         // how far inwards and outwards of the expected place is looked
  double min_contrast = 6;      // grey levels between the head and the ground inside of it
  double smallest_head_px = 3;  // narrower ones, far away, are biased by blur
  bool dark = false;            // the head is darker than both its sides
  bool noise = false;           // say the noise, which costs time
};

struct RailEdge {
  EdgePoint point;
  double ahead_m = 0;   // of the station; only as right as the shape it was looked for with
  double offset_m = 0;  // outwards from the expected place
  double contrast = 0;  // grey levels
  double noise = 0;     // grey levels, of the profile that it was found in
  double brighter = 0;  // grey level of the edge's brighter side, ...
  double darker = 0;    // ... and of the other
};

/// How many times brighter the one side of an edge is than the other, learnt where the camera shows both. From it and
/// the darker side follows by how much a burnt-out side is too bright for the camera.
class EdgeBrightness {
 public:
  void learn(const RailEdge& edge);
  /// How far the burnt-out side has swallowed the edge; unknown as long as nothing has been learnt.
  [[nodiscard]] std::optional<double> swallowed_px(double darker) const;

 private:
  double log_ratio_ = 0;
  int count_ = 0;
};

/// Grey levels across one rail; index 0 is innermost.
class EdgeProfile {
 public:
  EdgeProfile();
  /// `outward_px`: picture vector of one step outward; averaged over a few places along the rail.
  bool take(const cv::Mat& grey, const Eigen::Vector2d& first, const Eigen::Vector2d& outward_px,
            const Eigen::Vector2d& along, int count);
  [[nodiscard]] double mean(int first, int last) const;
  /// How much neighbouring pixels differ, in the median: edges do not count, noise does.
  [[nodiscard]] double noise();
  [[nodiscard]] int size() const { return static_cast<int>(values_.size()); }

 private:
  std::vector<double> values_;
  std::vector<double> sums_;
  std::vector<double> steps_;
};

/// Keeps its buffers between pictures.
class EdgeFinder {
 public:
  /// Points near to far, left rail first; valid until the next call. Stations outside the picture or without a clear
  /// edge give none. `tried`: how many stations of each side were inside the picture.
  const std::vector<RailEdge>& find(const cv::Mat& grey, const geometry::Intrinsics& camera, const TrackShape& shape,
                                    const EdgeOptions& options, int tried[2]);

  /// Where a rail is expected, in pixels: its inner edge, the other side of its head, and a place further along.
  struct Place {
    Eigen::Vector2d inner, outer, next;
  };
  enum class Look : uint8_t { outside, unclear, found };
  /// The inner edge of one rail at one place; `edge` is set (but for side and ahead_m) when it is found.
  Look find_at(const cv::Mat& grey, const Place& place, const EdgeOptions& options, RailEdge& edge) {
    return find_at(grey, place, options, {}, edge);
  }
  /// The edges that find() gave last are rails.
  void learn(bool dark);
  /// What was learnt is of another place.
  void forget() { brightness_ = {}; }

 private:
  Look find_at(const cv::Mat& grey, const Place& place, const EdgeOptions& options, const EdgeBrightness& brightness,
               RailEdge& edge);
  [[nodiscard]] static size_t rail(Side side, bool dark) { return (side == Side::left ? 0U : 1U) + (dark ? 2U : 0U); }

  EdgeProfile profile_;
  std::vector<RailEdge> edges_;
  std::array<EdgeBrightness, 4> brightness_;  // of the left and the right rail, bright and dark
};

}  // namespace railfix::track_detector
