// A centre line seen from the camera's foot: from a point (X, Y) of the track axes to arc length and lateral offset.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "simulator/line.hpp"
#include "track/alignment.hpp"

namespace railfix::simulator {

/// Arc length and lateral offset (left positive) of a point, with the local direction of the centre line.
struct OnTrack {
  float s_m;
  float d_m;
  float cos_heading;
  float sin_heading;
  float stretch;  // arc length along the centre line per metre along the point's own lane, 1 / (1 - curvature * d)
};

/// One table by X; X grows monotonically in the picture, so a point needs one look-up and a second-order correction.
class LocalTrack {
 public:
  static constexpr float kBehindM = -2.0F;
  static constexpr float kAheadM = 250.0F;
  static constexpr float kStepM = 0.25F;
  static constexpr float kExactM = 8.0F;   // further beside the track only grass grows
  static constexpr float kCantedM = 6.0F;  // as far beside the track the ground leans with its cant

  /// s_m counts from `s_origin_m` on the line's own scale.
  LocalTrack(const CentreLine& line, double s_origin_m, const track::TrackPoint& foot);

  /// False where the track has no point (before its beginning, behind its end or out of sight).
  [[nodiscard]] bool covers(float x_m) const { return x_m >= begin_m_ && x_m < end_m_; }
  [[nodiscard]] bool empty() const { return rows_.empty(); }
  [[nodiscard]] bool flat() const { return flat_; }
  /// 0 for the path itself, else the edge beside it.
  [[nodiscard]] uint32_t lane() const { return lane_; }
  /// REQUIRES covers(x_m).
  [[nodiscard]] OnTrack locate(float x_m, float y_m) const {
    const Row row = at(x_m);
    const float off = y_m - row.y;
    const float along = off * row.sin;
    const float across = off * row.cos;
    if (std::abs(off) > kExactM) return {row.s + along, across, row.cos, row.sin, 1.0F};
    const float stretch = 1.0F / (1.0F - row.curvature * across);
    return {row.s + along * stretch, across - 0.5F * row.curvature * along * along, row.cos, row.sin, stretch};
  }
  /// Height of the rail plane over the foot's track plane at a point, and how it grows with x. REQUIRES: not empty.
  struct Height {
    float z_m;
    float slope;
  };
  [[nodiscard]] Height height(float x_m, float y_m) const {
    const auto [a, b, w] = between(x_m);
    const float twist = a.twist + w * (b.twist - a.twist);
    const float beside = std::clamp(y_m - a.y, -kCantedM, kCantedM);
    return {a.z + w * (b.z - a.z) + twist * beside, (b.z - a.z) * (1.0F / kStepM)};
  }
  [[nodiscard]] float lowest_m() const { return lowest_m_; }
  [[nodiscard]] float highest_m() const { return highest_m_; }
  /// Steepest ray from `height_m` over the foot (rise per metre of x) that still meets the surface.
  [[nodiscard]] float steepest(float height_m) const;

 private:
  struct Row {
    float y, s, cos, sin, curvature, z, twist, unused;
  };
  /// The rows before and behind a place, and its share of the way from the one to the other.
  struct Between {
    const Row& a;
    const Row& b;
    float w;
  };
  [[nodiscard]] Between between(float x_m) const {
    const float position = (x_m - kBehindM) * (1.0F / kStepM) - static_cast<float>(first_);
    const auto index =
        static_cast<size_t>(std::clamp(static_cast<int>(position), 0, static_cast<int>(rows_.size()) - 2));
    return {rows_[index], rows_[index + 1], position - static_cast<float>(index)};
  }
  [[nodiscard]] Row at(float x_m) const {
    const auto [a, b, w] = between(x_m);
    return {a.y + w * (b.y - a.y),
            a.s + w * (b.s - a.s),
            a.cos + w * (b.cos - a.cos),
            a.sin + w * (b.sin - a.sin),
            a.curvature + w * (b.curvature - a.curvature),
            a.z + w * (b.z - a.z),
            a.twist + w * (b.twist - a.twist),
            0.0F};
  }
  struct Seen;
  void tabulate(const std::vector<Seen>& seen);
  std::vector<Row> rows_;
  int first_ = 0;  // grid index of the first row
  float begin_m_ = 0;
  float end_m_ = 0;
  float lowest_m_ = 0;
  float highest_m_ = 0;
  bool flat_ = true;
  uint32_t lane_ = 0;
};

}  // namespace railfix::simulator
