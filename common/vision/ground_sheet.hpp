// Top view of the ground between the rails: the picture resampled onto the texture sheet (sleeper tops and ballast).
//
// The sheet follows the track: row = distance along the track ahead of the camera's foot, near to far; column = offset
// from the track centre, right (negative) to left. On a track of constant curvature a step along the track is then a
// pure shift along the rows, and the rails stay outside the sheet in every curve.
#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "geometry/camera.hpp"

namespace railfix::vision {

/// The sheet's extent; the same for all pictures of a run.
struct Sheet {
  double near_m = 5.0;
  double half_width_m = 0.6;
  double cell_m = 0.02;
  int rows = 0;
  int cols = 0;

  [[nodiscard]] double ahead_m(double row) const { return near_m + row * cell_m; }
  [[nodiscard]] double offset_m(double col) const { return (col - 0.5 * (cols - 1)) * cell_m; }
};

/// Where the sheet lies against the camera.
struct SheetPose {
  geometry::CameraPose camera;
  double texture_depth_m = 0;  // of the sheet below the rail heads
  double curvature_per_m = 0;
  double vertical_curvature_per_m = 0;
  /// Camera above the sheet: this length is the scale of all metres.
  [[nodiscard]] double height_m() const { return camera.height_m + texture_depth_m; }
};

struct TopView {
  cv::Mat grey;                   // CV_32F, rows x cols of the sheet, lightly smoothed
  std::vector<uint8_t> row_seen;  // 1: the whole row lies in the picture
};

/// Largest sheet between near_m and far_m that this camera sees at this pose, `margin_rad` of extra pitch kept free.
Sheet fit_sheet(const geometry::Intrinsics& camera, const SheetPose& pose, double near_m, double far_m,
                double half_width_m, double cell_m, double margin_rad);

/// Resamples 8-bit pictures; keeps its buffers between pictures and touches only the pixels that the sheet covers.
class TopViewMaker {
 public:
  TopViewMaker(const geometry::Intrinsics& camera, const Sheet& sheet) : camera_(camera), sheet_(sheet) {}

  /// REQUIRES: grey is CV_8UC1 of the camera's size.
  void make(const cv::Mat& grey, const SheetPose& pose, TopView& out);
  [[nodiscard]] const Sheet& sheet() const { return sheet_; }

 private:
  void map_row(const SheetPose& pose, const Eigen::Matrix3d& camera_from_track, double ahead_m);
  void halve(const cv::Mat& grey, const SheetPose& pose, const Eigen::Matrix3d& camera_from_track, double fine_m);
  void smooth(cv::Mat& out);
  geometry::Intrinsics camera_;
  Sheet sheet_;
  cv::Mat half_;  // picture at half size: near rows see the ground finer than a cell
  cv::Mat sharp_;
  std::vector<float> line_;  // a row smoothed along the track, with a column to spare on either side
  std::vector<float> u_px_;
  std::vector<float> v_px_;
};

}  // namespace railfix::vision
