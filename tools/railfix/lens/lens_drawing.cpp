#include "lens/lens_drawing.hpp"

#include <cstdio>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

namespace railfix::tool {
namespace {

constexpr float kResidualScale = 100;
const cv::Scalar kGreen(80, 220, 80);
const cv::Scalar kRed(60, 60, 240);

void write_text(cv::Mat& picture, const std::string& text) {
  const double scale = picture.cols / 1280.0;
  const cv::Point at(static_cast<int>(16 * scale), static_cast<int>(36 * scale));
  cv::putText(picture, text, at, cv::FONT_HERSHEY_SIMPLEX, scale, {0, 0, 0}, 4, cv::LINE_AA);
  cv::putText(picture, text, at, cv::FONT_HERSHEY_SIMPLEX, scale, {255, 255, 255}, 1, cv::LINE_AA);
}

cv::Mat undistorted(const LensCalibration& found, const cv::Mat& grey, const BoardView& view) {
  const auto& c = found.lens;
  const cv::Matx33d camera(c.fu_px, 0, c.cu_px, 0, c.fv_px, c.cv_px, 0, 0, 1);
  const cv::Vec4d distortion(c.k1, c.k2, c.p1, c.p2);
  cv::Mat straight;
  cv::undistort(grey, straight, camera, distortion);
  cv::Mat colour;
  cv::cvtColor(straight, colour, cv::COLOR_GRAY2BGR);
  std::vector<cv::Point2f> corners;
  cv::undistortPoints(view.pixels, corners, camera, distortion, cv::noArray(), camera);
  for (size_t i = 1; i < corners.size(); ++i) {
    if (view.board_m[i].y == view.board_m[i - 1].y)
      cv::line(colour, corners[i - 1], corners[i], kGreen, 1, cv::LINE_AA);
  }
  write_text(colour, "without distortion: edges must be straight");
  return colour;
}

cv::Mat residuals(const LensCalibration& found, const cv::Size& size) {
  cv::Mat field(size, CV_8UC3, cv::Scalar(40, 40, 40));
  for (const auto& view : found.views) {
    for (size_t i = 0; i < view.reprojected.size(); ++i) {
      const cv::Point2f at = view.board.pixels[i];
      cv::circle(field, at, 1, kGreen, -1);
      cv::line(field, at, at + kResidualScale * (view.reprojected[i] - at), kRed, 1, cv::LINE_AA);
    }
  }
  char text[120];
  std::snprintf(text, sizeof text, "%zu pictures, residuals x 100, RMS %.3f px", found.views.size(), found.rms_px);
  write_text(field, text);
  return field;
}

}  // namespace

cv::Mat draw_lens(const LensCalibration& found, const cv::Mat& grey, const BoardView& view) {
  cv::Mat both;
  cv::hconcat(undistorted(found, grey, view), residuals(found, grey.size()), both);
  return both;
}

}  // namespace railfix::tool
