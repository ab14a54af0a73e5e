// Where a roof takes the sky's light from the ground between the rails: under a bridge, behind a portal. Walls alone
// (noise barriers, lorries on both sides of a crossing) do not.
#pragma once

#include <array>
#include <optional>
#include <vector>

#include "vision/ground_sheet.hpp"

namespace railfix::track_detector {

class GroundShade {
 public:
  GroundShade();
  /// The ground as one picture shows it; way_m: where the train was then.
  void add(const vision::TopView& view, const vision::Sheet& sheet, double way_m);
  /// Brightness of the ground behind a place, where it is darkest over the length of some sleepers, as a share of that
  /// before it, in the same pictures; nothing when no picture has shown both.
  [[nodiscard]] std::optional<double> share(double place_m) const;
  void forget() { count_ = 0; }

 private:
  static constexpr size_t kPieces = 22;
  static constexpr size_t kLooks = 40;
  struct Look {
    double way_m = 0, near_m = 0;
    std::array<float, kPieces> grey{};  // from near to far; negative: not seen
  };
  [[nodiscard]] static std::optional<double> mean_grey(const Look& look, double from_m, double to_m);
  [[nodiscard]] static std::optional<double> share(const Look& look, double ahead_m);

  std::vector<Look> looks_;  // ring
  size_t newest_ = 0;
  size_t count_ = 0;
};

}  // namespace railfix::track_detector
