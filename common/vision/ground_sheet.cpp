#include "vision/ground_sheet.hpp"

#include <algorithm>
#include <cmath>

#include <initializer_list>
#include "vision/picture_line.hpp"

namespace railfix::vision {
namespace {

// Point of the sheet's centre line and the direction of growing offset there, in track axes.
struct SheetRow {
  Eigen::Vector3d centre_m;
  Eigen::Vector3d left;
};

SheetRow sheet_row(const SheetPose& pose, double ahead_m) {
  const double turn = pose.curvature_per_m * ahead_m;
  // Series of sin(turn)/curvature and (1 - cos(turn))/curvature: exact to 1e-6 m up to 15 m at a radius of 100 m.
  const double along = ahead_m * (1.0 - turn * turn / 6.0);
  const double aside = 0.5 * ahead_m * turn * (1.0 - turn * turn / 12.0);
  const double up = 0.5 * pose.vertical_curvature_per_m * ahead_m * ahead_m - pose.texture_depth_m;
  return {{along, aside, up}, {-std::sin(turn), std::cos(turn), 0.0}};
}

}  // namespace

Sheet fit_sheet(const geometry::Intrinsics& camera, const SheetPose& pose, double near_m, double far_m,
                double half_width_m, double cell_m, double margin_rad) {
  SheetPose raised = pose;  // the camera looks further up by the margin: the near edge of what it then sees
  raised.camera.pitch_rad -= margin_rad;
  raised.curvature_per_m = 0;
  raised.vertical_curvature_per_m = 0;
  const geometry::View view(camera, raised.camera);
  Sheet sheet;
  sheet.half_width_m = half_width_m;
  sheet.cell_m = cell_m;
  sheet.cols = static_cast<int>(2.0 * half_width_m / cell_m) + 1;
  const auto visible = [&](double ahead_m) {
    for (const double side : {-1.0, 1.0}) {
      const auto pixel = view.project({ahead_m, side * half_width_m, -pose.texture_depth_m});
      if (!pixel || pixel->x() < 1 || pixel->y() < 1 || pixel->x() > camera.width_px - 2 ||
          pixel->y() > camera.height_px - 2) {
        return false;
      }
    }
    return true;
  };
  double begin_m = near_m;
  while (begin_m < far_m && !visible(begin_m)) begin_m += cell_m;
  double end_m = begin_m;
  while (end_m < far_m && visible(end_m)) end_m += cell_m;
  sheet.near_m = begin_m;
  sheet.rows = static_cast<int>((end_m - begin_m) / cell_m);
  return sheet;
}

void TopViewMaker::map_row(const SheetPose& pose, const Eigen::Matrix3d& camera_from_track, double ahead_m) {
  const SheetRow row = sheet_row(pose, ahead_m);
  const Eigen::Vector3d position(0.0, pose.camera.lateral_m, pose.camera.height_m);
  const Eigen::Vector3f start =
      (camera_from_track * (row.centre_m + row.left * sheet_.offset_m(0) - position)).cast<float>();
  const Eigen::Vector3f step = (camera_from_track * row.left * sheet_.cell_m).cast<float>();
  project_line(camera_, start, step, sheet_.cols, u_px_.data(), v_px_.data());
}

// Mean of two by two pixels, where the sheet is nearer than fine_m.
void TopViewMaker::halve(const cv::Mat& grey, const SheetPose& pose, const Eigen::Matrix3d& camera_from_track,
                         double fine_m) {
  constexpr float kMarginPx = 8;  // distortion bends the sheet's outline
  half_.create(grey.rows / 2, grey.cols / 2, CV_8UC1);
  float u_min = 1e9F, u_max = -1e9F, v_min = 1e9F, v_max = -1e9F;
  for (const double ahead_m : {sheet_.ahead_m(0), std::min(fine_m, sheet_.ahead_m(sheet_.rows - 1))}) {
    map_row(pose, camera_from_track, ahead_m);
    for (const auto& [u, v] : {std::pair(u_px_.front(), v_px_.front()), std::pair(u_px_.back(), v_px_.back())}) {
      u_min = std::min(u_min, u);
      u_max = std::max(u_max, u);
      v_min = std::min(v_min, v);
      v_max = std::max(v_max, v);
    }
  }
  const auto half = [](float px, int limit) {
    return static_cast<int>(std::clamp(0.5F * px, 0.0F, static_cast<float>(limit)));
  };
  const int first = half(u_min - kMarginPx, half_.cols);
  const int end = half(u_max + kMarginPx, half_.cols);
  for (int v = half(v_min - kMarginPx, half_.rows); v < half(v_max + kMarginPx, half_.rows); ++v) {
    const uchar* top = grey.ptr<uchar>(2 * v);
    const uchar* bottom = grey.ptr<uchar>(2 * v + 1);
    uchar* out = half_.ptr<uchar>(v);
    for (int u = first; u < end; ++u)
      out[u] = static_cast<uchar>((top[2 * u] + top[2 * u + 1] + bottom[2 * u] + bottom[2 * u + 1] + 2) >> 2);
  }
}

// 1 2 1 in both directions: a standard deviation of 0.7 cells.
void TopViewMaker::smooth(cv::Mat& out) {
  const int rows = sheet_.rows;
  const int cols = sheet_.cols;
  out.create(rows, cols, CV_32F);
  line_.resize(static_cast<size_t>(cols) + 2);
  for (int r = 0; r < rows; ++r) {
    const auto* above = sharp_.ptr<float>(std::max(0, r - 1));
    const auto* here = sharp_.ptr<float>(r);
    const auto* below = sharp_.ptr<float>(std::min(rows - 1, r + 1));
    float* line = line_.data() + 1;
    for (int c = 0; c < cols; ++c) line[c] = 0.25F * (above[c] + below[c]) + 0.5F * here[c];
    line[-1] = line[0];
    line[cols] = line[cols - 1];
    auto* to = out.ptr<float>(r);
    for (int c = 0; c < cols; ++c) to[c] = 0.25F * (line[c - 1] + line[c + 1]) + 0.5F * line[c];
  }
}

void TopViewMaker::make(const cv::Mat& grey, const SheetPose& pose, TopView& out) {
  const auto cols = static_cast<size_t>(sheet_.cols);
  u_px_.resize(cols);
  v_px_.resize(cols);
  sharp_.create(sheet_.rows, sheet_.cols, CV_32F);
  out.row_seen.assign(static_cast<size_t>(sheet_.rows), 0);

  const Eigen::Matrix3d camera_from_track = geometry::rotation_camera_from_track(pose.camera);
  // Along the track a picture row covers (X^2 + H^2) / (f H) of ground: below half a cell the half-size picture is the
  // right one.
  const double height_m = pose.height_m();
  const double fine_m = std::sqrt(std::max(0.0, 0.6 * sheet_.cell_m * camera_.fv_px * height_m - height_m * height_m));
  if (fine_m > sheet_.near_m) halve(grey, pose, camera_from_track, fine_m);
  for (int row = 0; row < sheet_.rows; ++row) {
    const double ahead_m = sheet_.ahead_m(row);
    map_row(pose, camera_from_track, ahead_m);
    auto* line = sharp_.ptr<float>(row);
    const auto [u_min, u_max] = std::ranges::minmax(u_px_);
    const auto [v_min, v_max] = std::ranges::minmax(v_px_);  // a lens bends the row
    const bool seen = u_min >= 1 && v_min >= 1 && u_max < static_cast<float>(camera_.width_px - 3) &&
                      v_max < static_cast<float>(camera_.height_px - 3);
    out.row_seen[static_cast<size_t>(row)] = seen ? 1 : 0;
    if (!seen) {
      std::fill(line, line + cols, 0.0F);
    } else if (ahead_m < fine_m) {
      for (size_t c = 0; c < cols; ++c) line[c] = bilinear(half_, 0.5F * u_px_[c] - 0.25F, 0.5F * v_px_[c] - 0.25F);
    } else {
      for (size_t c = 0; c < cols; ++c) line[c] = bilinear(grey, u_px_[c], v_px_[c]);
    }
  }
  // The smoothing carries an unseen row's emptiness into its neighbours.
  uint8_t before = 1;
  for (size_t row = 0; row + 1 < out.row_seen.size(); ++row) {
    const uint8_t here = out.row_seen[row];
    out.row_seen[row] = before & here & out.row_seen[row + 1];
    before = here;
  }
  smooth(out.grey);
}

}  // namespace railfix::vision
