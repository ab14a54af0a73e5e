#include "frame_grabber/picture_health.hpp"

#include <algorithm>
#include <array>
#include <cstring>

namespace railfix::frame_grabber {
namespace {

constexpr int kGrid = 8;  // every eighth pixel of every eighth row
constexpr int kSaturatedGrey = 250;
constexpr double kDarkShare = 0.95;

bool equal(const cv::Mat& a, const cv::Mat& b) {
  if (a.size() != b.size()) return false;
  for (int row = 0; row < a.rows; ++row) {
    if (std::memcmp(a.ptr(row), b.ptr(row), static_cast<size_t>(a.cols)) != 0) return false;
  }
  return true;
}

}  // namespace

uint32_t PictureHealth::judge(int64_t stamp_ns, const cv::Mat& grey) {
  std::array<size_t, 256> histogram{};
  size_t pixels = 0;
  for (int row = kGrid / 2 < grey.rows ? kGrid / 2 : 0; row < grey.rows; row += kGrid) {
    const uint8_t* values = grey.ptr(row);
    for (int column = 0; column < grey.cols; column += kGrid, ++pixels) ++histogram[values[column]];
  }
  const auto share = [&](size_t from, size_t to) {
    size_t count = 0;
    for (size_t value = from; value < to; ++value) count += histogram[value];
    return static_cast<double>(count) / static_cast<double>(pixels);
  };
  uint32_t health = 0;
  const auto dark = static_cast<size_t>(std::clamp(config_.dark_below_grey, 0.0, 256.0));
  if (share(0, dark) >= kDarkShare) health |= kDark;
  if (share(kSaturatedGrey, 256) >= config_.saturated_share) health |= kSaturated;
  equal_pictures_ = equal(grey, last_) ? equal_pictures_ + 1 : 0;
  if (equal_pictures_ >= config_.frozen_after_pictures) health |= kFrozen;
  if (newest_ns_ && stamp_ns <= *newest_ns_) health |= kOutOfOrder;
  newest_ns_ = std::max(stamp_ns, newest_ns_.value_or(stamp_ns));
  last_ = grey;
  return health;
}

}  // namespace railfix::frame_grabber
