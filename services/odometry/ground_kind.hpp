// Which rows of the top view show ballast, and which sleepers?
//
// Ballast lies some centimetres below the sleeper tops; 1 cm is 0.4 % of motion. Seen from above it is rough along a
// row, a sleeper is smooth. The ballast right beside a sleeper is hidden or laid bare by it and belongs to neither.
#pragma once

#include <cstdint>
#include <vector>

#include "vision/ground_sheet.hpp"

namespace railfix::odometry {

enum class Ground : uint8_t { sleeper, ballast, mixed };

/// One per row. Where the two cannot be told apart all is sleeper: the texture plane.
std::vector<Ground> find_ground(const vision::TopView& view, const vision::Sheet& sheet);

}  // namespace railfix::odometry
