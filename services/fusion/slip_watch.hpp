// Compares the wheel's way with the camera's way over the last second, outside the filter: a filter that uses both
// follows a growing slip with its scales and never sees one large innovation.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "fusion/fusion_types.hpp"
#include "fusion/seen_way.hpp"

namespace railfix::fusion {

/// A plain value. Feed it every wheel sample and every odometry step that the filter believed, in the order of their
/// stamps.
class SlipWatch {
 public:
  void wheel(int64_t stamp_ns, double wheel_m);
  /// The camera measured nothing or nothing credible: the comparison begins anew.
  void no_picture();

  /// Way over the comparison window, by both.
  struct Ways {
    double visual_m = 0;
    double wheel_m = 0;
    int steps = 0;
    double time_s = 0;
  };
  /// Way since the oldest picture of the window; nothing while the window is too short.
  std::optional<Ways> picture(const OdometryInput& step);

 private:
  struct Reading {
    int64_t stamp_ns = 0;
    double metres = 0;
  };
  struct Mark {
    int64_t stamp_ns = 0;
    double visual_m = 0;
    double wheel_m = 0;
    int steps = 0;
  };
  [[nodiscard]] std::optional<double> wheel_at(int64_t stamp_ns) const;

  Reading wheel_before_;
  Reading wheel_last_;
  SeenWay seen_;
  std::vector<Mark> marks_;  // one each kMarkS
  int steps_ = 0;
};

}  // namespace railfix::fusion
