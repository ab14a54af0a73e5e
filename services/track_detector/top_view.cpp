#include "track_detector/top_view.hpp"

#include <algorithm>
#include <cmath>

namespace railfix::track_detector {
namespace {

constexpr int kSubRows = 4;      // averaged along the track: ballast is rough, rails are not
constexpr double kHeadM = 0.06;  // a little less than the head, for heads that are bright on their crown only
constexpr double kGapM = 0.02;
constexpr double kSideM = 0.06;
constexpr int kOne = 256;  // a pixel, in units of the samples' weights
constexpr float kNoiseGrey = 4.0F;
constexpr double kClearestShare = 0.96;

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
  const float per_head = 1.0F / static_cast<float>(2 * half + 1);
  const float per_side = 1.0F / static_cast<float>(side);
  const float* sum = sums.data();
  for (int c = reach; c < columns - reach - 1; ++c) {
    const float head = (sum[c + half + 1] - sum[c - half]) * per_head;
    const float right = (sum[c - half - gap] - sum[c - reach]) * per_side;
    const float left = (sum[c + reach + 1] - sum[c + half + gap + 1]) * per_side;
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
  for (int r = 0; r < size.rows; ++r) {
    ahead_m_.push_back(near_m * std::pow(ratio, r));
    for (int c = 0; c < columns_; ++c) {
      for (int k = 0; k < kSubRows; ++k) {
        const double ahead_m = near_m * std::pow(ratio, r + (k - 0.5 * (kSubRows - 1)) / kSubRows);
        const auto pixel = view.project({ahead_m, first_y_m_ + c * size.column_m, 0.0});
        // Outside the picture its border counts.
        const auto place = [](double px, int size_px) {
          return static_cast<int>(kOne * std::clamp(px, 0.0, size_px - 1.01) + 0.5);
        };
        const int u = pixel ? place(pixel->x(), camera.width_px) : 0;
        const int v = pixel ? place(pixel->y(), camera.height_px) : 0;
        samples_.push_back({static_cast<int16_t>(u / kOne), static_cast<int16_t>(v / kOne),
                            static_cast<uint16_t>(u % kOne), static_cast<uint16_t>(v % kOne)});
      }
    }
  }
}

void TopView::look(const cv::Mat& grey) {
  means_.create(size_.rows, columns_, CV_32F);
  const auto* sample = samples_.data();
  const auto row_step = static_cast<ptrdiff_t>(grey.step);
  for (int r = 0; r < size_.rows; ++r) {
    auto* mean = means_.ptr<float>(r);
    for (int c = 0; c < columns_; ++c) {
      int sum = 0;
      for (int k = 0; k < kSubRows; ++k, ++sample) {
        const uint8_t* upper = grey.data + sample->v * row_step + sample->u;
        const uint8_t* lower = upper + row_step;
        const int right = sample->right;
        const int below = sample->below;
        sum += (upper[0] * (kOne - right) + upper[1] * right) * (kOne - below) +
               (lower[0] * (kOne - right) + lower[1] * right) * below;
      }
      mean[c] = static_cast<float>(sum) * (1.0F / (kOne * kOne * kSubRows));
    }
  }
}

const cv::Mat& TopView::ridges(bool dark) {
  scores_.create(size_.rows, columns_, CV_32F);
  for (int r = 0; r < size_.rows; ++r) {
    auto* score = scores_.ptr<float>(r);
    band_contrast(means_.ptr<float>(r), columns_, size_.column_m, dark ? -1.0F : 1.0F, sums_, score);
    sorted_.assign(score, score + columns_);
    const auto clearest =
        sorted_.begin() + static_cast<std::ptrdiff_t>(kClearestShare * static_cast<double>(columns_ - 1));
    std::nth_element(sorted_.begin(), clearest, sorted_.end());
    const float scale = 1.0F / (*clearest + kNoiseGrey);
    for (int c = 0; c < columns_; ++c) score[c] = std::min(1.0F, score[c] * scale);
  }
  return scores_;
}

}  // namespace railfix::track_detector
