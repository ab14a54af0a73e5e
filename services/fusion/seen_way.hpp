// The way that the camera has seen, from odometry steps that count from earlier pictures.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "fusion/fusion_types.hpp"

namespace railfix::fusion {

/// A plain value.
class SeenWay {
 public:
  struct Picture {
    int64_t stamp_ns = 0;
    double way_m = 0;  // since the first one
    double variance_m2 = 0;
  };
  /// REQUIRES: step.valid. Nothing where it counts from a picture that is not known.
  std::optional<Picture> add(const OdometryInput& step);
  /// The way begins with the picture of that stamp.
  void begin(int64_t stamp_ns) { pictures_ = {{stamp_ns, 0, 0}}; }
  void clear() { pictures_.clear(); }

 private:
  std::vector<Picture> pictures_;  // that steps may count from
};

}  // namespace railfix::fusion
