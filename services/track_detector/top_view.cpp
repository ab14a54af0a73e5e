#include "track_detector/top_view.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace railfix::track_detector {
namespace {

constexpr int kSubRows = 4;      // averaged along the track: ballast is rough, rails are not
constexpr double kHeadM = 0.06;  // a little less than the head, for heads that are bright on their crown only
constexpr double kGapM = 0.02;
constexpr double kSideM = 0.06;
constexpr float kNoiseGrey = 4.0F;
constexpr double kClearestShare = 0.96;

/// Mean of columns [first, last) from prefix sums.
float mean(const std::vector<float>& sums, int first, int last) {
  return (sums[static_cast<size_t>(last)] - sums[static_cast<size_t>(first)]) / static_cast<float>(last - first);
}

/// How much a band around each column is brighter than both its sides (grey levels, at least 0).
void band_contrast(const float* grey, int columns, double column_m, float sign, std::vector<float>& sums,
                   float* contrast) {
  sums.resize(static_cast<size_t>(columns) + 1);
  sums[0] = 0;
  for (int c = 0; c < columns; ++c) sums[static_cast<size_t>(c) + 1] = sums[static_cast<size_t>(c)] + grey[c];
  const int half = std::max(1, static_cast<int>(std::lround(kHeadM / 2 / column_m)));
  const int gap = std::max(1, static_cast<int>(std::lround(kGapM / column_m)));
  const int side = std::max(1, static_cast<int>(std::lround(kSideM / column_m)));
  const int reach = half + gap + side;
  std::fill(contrast, contrast + columns, 0.0F);
  for (int c = reach; c + reach + 1 < columns; ++c) {
    const float head = mean(sums, c - half, c + half + 1);
    const float right = mean(sums, c - reach, c - half - gap);
    const float left = mean(sums, c + half + gap + 1, c + reach + 1);
    contrast[c] = std::max(0.0F, std::min(sign * (head - right), sign * (head - left)));
  }
}

}  // namespace

double nearest_visible_m(const geometry::Intrinsics& camera, const geometry::CameraPose& pose, double side_m,
                         double far_m) {
  const geometry::View view(camera, pose);
  for (double x = 1.0; x < far_m; x *= 1.02) {
    bool both = true;
    for (const double y : {-side_m, side_m}) {
      const auto pixel = view.project({x, y, 0.0});
      both = both && pixel && pixel->x() >= 2 && pixel->y() >= 2 && pixel->x() < camera.width_px - 3 &&
             pixel->y() < camera.height_px - 3;
    }
    if (both) return x;
  }
  return far_m;
}

TopView::TopView(const geometry::Intrinsics& camera, const geometry::CameraPose& pose, const TopViewSize& size)
    : pose_(pose), size_(size) {
  columns_ = 2 * static_cast<int>(std::lround(size.half_width_m / size.column_m)) + 1;
  first_y_m_ = -size.half_width_m;
  const double near_m = nearest_visible_m(camera, pose, 0.5, size.far_m * 0.7);
  const double ratio = std::pow(size.far_m / near_m, 1.0 / (size.rows - 1));
  const geometry::View view(camera, pose);
  map_.create(size.rows * kSubRows, columns_, CV_32FC2);
  for (int r = 0; r < map_.rows; ++r) {
    const double ahead_m = near_m * std::pow(ratio, (r - 0.5 * (kSubRows - 1)) / kSubRows);
    if (r % kSubRows == 0) ahead_m_.push_back(near_m * std::pow(ratio, r / kSubRows));
    for (int c = 0; c < columns_; ++c) {
      const auto pixel = view.project({ahead_m, first_y_m_ + c * size.column_m, 0.0});
      // Outside the picture: far away, remap answers with the border value.
      map_.at<cv::Vec2f>(r, c) =
          pixel ? cv::Vec2f(static_cast<float>(pixel->x()), static_cast<float>(pixel->y())) : cv::Vec2f(-1e4F, -1e4F);
    }
  }
}

cv::Mat TopView::ridges(const cv::Mat& grey, bool dark) const {
  cv::Mat samples;
  cv::remap(grey, samples, map_, cv::noArray(), cv::INTER_LINEAR, cv::BORDER_REPLICATE);
  cv::Mat scores(size_.rows, columns_, CV_32F);
  std::vector<float> row(static_cast<size_t>(columns_));
  std::vector<float> sums;
  std::vector<float> sorted;
  for (int r = 0; r < size_.rows; ++r) {
    std::fill(row.begin(), row.end(), 0.0F);
    for (int s = 0; s < kSubRows; ++s) {
      const auto* sample = samples.ptr<uint8_t>(r * kSubRows + s);
      for (int c = 0; c < columns_; ++c) row[static_cast<size_t>(c)] += sample[c];
    }
    for (auto& value : row) value /= kSubRows;
    auto* score = scores.ptr<float>(r);
    band_contrast(row.data(), columns_, size_.column_m, dark ? -1.0F : 1.0F, sums, score);
    sorted.assign(score, score + columns_);
    const auto clearest =
        sorted.begin() + static_cast<std::ptrdiff_t>(kClearestShare * static_cast<double>(columns_ - 1));
    std::nth_element(sorted.begin(), clearest, sorted.end());
    const float scale = 1.0F / (*clearest + kNoiseGrey);
    for (int c = 0; c < columns_; ++c) score[c] = std::min(1.0F, score[c] * scale);
  }
  return scores;
}

}  // namespace railfix::track_detector
