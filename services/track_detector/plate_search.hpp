// Plates of a given size in the top view of the ground between the rails.
#pragma once

#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "track_detector/landmark_types.hpp"
#include "track_detector/plate_evidence.hpp"
#include "vision/ground_sheet.hpp"

namespace railfix::track_detector {

/// Keeps its buffers between pictures.
class PlateSearch {
 public:
  PlateSearch(const vision::Sheet& sheet, const LandmarkOptions& options);

  /// Best first; no two overlap. Valid until the next call.
  const std::vector<GroundCandidate>& find(const vision::TopView& view, const PlateBlur& blur);

 private:
  struct Hit {
    int row, col;
    double contrast;  // signed, of the weakest side
  };
  std::optional<GroundCandidate> refine(const cv::Mat& grey, const Hit& hit, const PlateBlur& blur);

  vision::Sheet sheet_;
  LandmarkOptions options_;
  AreaSums sums_;
  PlateEvidence evidence_;
  std::vector<double> along_, across_;
  std::vector<Hit> hits_;
  std::vector<GroundCandidate> found_;
};

}  // namespace railfix::track_detector
