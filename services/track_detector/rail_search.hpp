// Finds both rails in a single picture: every shake and curvature within the limits is tried on the ridge scores of the
// top view, both rails together at the gauge. No start from a previous picture is needed.
#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "track_detector/rail_fit.hpp"
#include "track_detector/top_view.hpp"

namespace railfix::track_detector {

/// Half widths of what is tried about the top view's pose.
struct SearchLimits {
  double pitch_rad = 0.02;
  double yaw_rad = 0.03;
  double lateral_m = 0.3;         // with roll: where between the rails the camera is
  double height_fraction = 0.05;  // of the height
  double curvature_per_m = 1.0 / 180;
};

struct RailCandidate {
  TrackShape shape;
  double score = 0;  // 0..1: how clear and how complete both rails are
  double left_score = 0;
  double right_score = 0;
};

/// The best candidates, best first, well apart from each other; may be empty. `head_m`: width of the rail head.
std::vector<RailCandidate> search_rails(const TopView& view, const cv::Mat& ridges, const SearchLimits& limits,
                                        double gauge_m, double head_m, size_t max_candidates);

}  // namespace railfix::track_detector
