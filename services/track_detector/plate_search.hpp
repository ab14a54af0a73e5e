// Plates of a given size in the top view of the ground between the rails.
#pragma once

#include <vector>

#include "track_detector/landmark_types.hpp"
#include "vision/ground_sheet.hpp"

namespace railfix::track_detector {

/// Best first; no two overlap.
std::vector<GroundCandidate> find_plates(const vision::TopView& view, const vision::Sheet& sheet,
                                         const LandmarkOptions& options);

}  // namespace railfix::track_detector
