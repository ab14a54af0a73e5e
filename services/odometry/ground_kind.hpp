// Which rows of the top view show ballast, and which sleepers?
//
// Ballast lies some centimetres below the sleeper tops; 1 cm is 0.4 % of motion. Seen from above it is rough along a
// row, a sleeper is smooth. The ballast right beside a sleeper is hidden or laid bare by it and belongs to neither; nor
// does the sleeper's front edge, where its front face is seen.
#pragma once

#include <cstdint>
#include <vector>

#include "vision/ground_sheet.hpp"

namespace railfix::odometry {

enum class Ground : uint8_t { sleeper, ballast, mixed };

/// Keeps its buffers between pictures.
class GroundFinder {
 public:
  /// One per row. Where the two cannot be told apart all is sleeper: the texture plane.
  void find(const vision::TopView& view, const vision::Sheet& sheet, std::vector<Ground>& out);

 private:
  void measure_roughness(const vision::TopView& view);
  void mark_ballast(const vision::TopView& view, int half_window);
  [[nodiscard]] bool any(uint8_t ballast, int first, int last) const;
  std::vector<float> squared_;    // of differences along a row, mean
  std::vector<float> roughness_;  // its root over three rows
  std::vector<float> window_;
  std::vector<uint8_t> ballast_;
};

}  // namespace railfix::odometry
