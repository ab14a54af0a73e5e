// Plates of a given size in the top view of the ground between the rails.
#pragma once

#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "track_detector/landmark_types.hpp"
#include "vision/ground_sheet.hpp"

namespace railfix::track_detector {

struct CellBox {
  int row, col, rows, cols;
};

/// Mean and spread of any box of a CV_32F picture.
class AreaSums {
 public:
  void set(const cv::Mat& grey);
  [[nodiscard]] double mean(const CellBox& box) const { return of(sums_, box) / (box.rows * box.cols); }
  [[nodiscard]] double spread(const CellBox& box) const;

 private:
  [[nodiscard]] double of(const std::vector<double>& sums, const CellBox& box) const;
  size_t step_ = 0;
  std::vector<double> sums_, squared_;
};

/// Keeps its buffers between pictures.
class PlateSearch {
 public:
  PlateSearch(const vision::Sheet& sheet, const LandmarkOptions& options);

  /// Best first; no two overlap. Valid until the next call.
  const std::vector<GroundCandidate>& find(const vision::TopView& view);

 private:
  struct Hit {
    int row, col;
    double contrast;  // signed, of the weakest side
  };
  std::optional<GroundCandidate> refine(const cv::Mat& grey, const Hit& hit);

  vision::Sheet sheet_;
  LandmarkOptions options_;
  AreaSums sums_;
  std::vector<double> along_, across_;
  std::vector<Hit> hits_;
  std::vector<GroundCandidate> found_;
};

}  // namespace railfix::track_detector
