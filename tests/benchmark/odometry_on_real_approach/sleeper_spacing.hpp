// How far sleepers lie apart in top views: a check of the scale that owes nothing to the gauge.
#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "vision/ground_sheet.hpp"

namespace railfix {

class SleeperSpacing {
 public:
  SleeperSpacing(const geometry::Intrinsics& camera, const vision::SheetPose& mount, double far_m);
  /// Adds one picture and returns its ground, CV_32F.
  cv::Mat add(const cv::Mat& grey, const vision::SheetPose& pose);
  /// Mean over all pictures.
  [[nodiscard]] double spacing_m() const;
  [[nodiscard]] const vision::Sheet& sheet() const { return maker_.sheet(); }

 private:
  vision::TopViewMaker maker_;
  std::vector<double> sums_;  // autocorrelation by rows of shift, of all pictures
};

}  // namespace railfix
