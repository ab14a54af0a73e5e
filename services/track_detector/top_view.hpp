// Where rail heads may be, seen from above: the picture rectified to the plane of the rail heads and turned into a
// ridge score, row by row from near to far.
#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "geometry/camera.hpp"

namespace railfix::track_detector {

struct TopViewSize {
  double far_m = 30;
  double half_width_m = 3;
  int rows = 32;
  double column_m = 0.02;
};

/// Made once for a camera pose, used for every picture.
class TopView {
 public:
  TopView(const geometry::Intrinsics& camera, const geometry::CameraPose& pose, const TopViewSize& size);

  /// Takes a picture in; ridges() then scores it.
  void look(const cv::Mat& grey);
  /// Ridge score 0..1 (CV_32F, rows x columns): 1 where a band as wide as a rail head stands out on both sides as
  /// clearly as the clearest ones of its row. `dark`: look for bands darker than both sides (rusty rails in snow).
  /// Valid until the next call.
  const cv::Mat& ridges(bool dark);

  [[nodiscard]] int rows() const { return size_.rows; }
  [[nodiscard]] int columns() const { return columns_; }
  [[nodiscard]] double ahead_m(int row) const { return ahead_m_[static_cast<size_t>(row)]; }
  /// Column of a lateral position (left positive), with fraction.
  [[nodiscard]] double column_of(double y_m) const { return (y_m - first_y_m_) / size_.column_m; }
  [[nodiscard]] const geometry::CameraPose& pose() const { return pose_; }
  [[nodiscard]] double column_m() const { return size_.column_m; }

 private:
  geometry::CameraPose pose_;
  TopViewSize size_;
  int columns_ = 0;
  double first_y_m_ = 0;
  std::vector<double> ahead_m_;
  /// A pixel of the picture and the weights of its right and lower neighbours, in 256ths.
  struct Sample {
    int16_t u, v;
    uint16_t right, below;
  };
  std::vector<Sample> samples_;  // kSubRows in turn for every cell of the view
  cv::Mat means_;                // CV_32F, rows x columns
  cv::Mat scores_;               // CV_32F, rows x columns
  std::vector<float> sums_;
  std::vector<float> sorted_;
};

/// Smallest X at which the track centre +-side_m is in the picture; nothing visible: far_m.
double nearest_visible_m(const geometry::Intrinsics& camera, const geometry::CameraPose& pose, double side_m,
                         double far_m);

}  // namespace railfix::track_detector
