#include "sleeper_spacing.hpp"

#include <algorithm>
#include <cmath>

namespace railfix {
namespace {

constexpr double kNearM = 4, kHalfWidthM = 0.6, kCellM = 0.02, kMarginRad = 0.02;
constexpr double kCountedToM = 14;  // farther sleepers are blurred
constexpr int kPeriods = 4;         // the farther the peak, the finer the spacing
constexpr double kShortestM = 0.45, kLongestM = 0.75;

// Brightness of the rows, less what changes over more than a sleeper's distance.
std::vector<double> profile_of(const vision::TopView& view, const vision::Sheet& sheet) {
  std::vector<double> means;
  for (int r = 0; r < sheet.rows && sheet.ahead_m(r) < kCountedToM; ++r) {
    if (view.row_seen[static_cast<size_t>(r)] != 0) means.push_back(cv::mean(view.grey.row(r))[0]);
  }
  const int half = static_cast<int>(0.5 * kLongestM / kCellM);
  std::vector<double> profile;
  for (int r = half; r + half < static_cast<int>(means.size()); ++r) {
    double sum = 0;
    for (int k = -half; k <= half; ++k) sum += means[static_cast<size_t>(r + k)];
    profile.push_back(means[static_cast<size_t>(r)] - sum / (2 * half + 1));
  }
  return profile;
}

}  // namespace

SleeperSpacing::SleeperSpacing(const geometry::Intrinsics& camera, const vision::SheetPose& mount, double far_m)
    : maker_(camera, vision::fit_sheet(camera, mount, kNearM, far_m, kHalfWidthM, kCellM, kMarginRad)),
      sums_(static_cast<size_t>((kPeriods + 1) * kLongestM / kCellM), 0.0) {}

cv::Mat SleeperSpacing::add(const cv::Mat& grey, const vision::SheetPose& pose) {
  vision::TopView view;
  maker_.make(grey, pose, view);
  const std::vector<double> profile = profile_of(view, maker_.sheet());
  double energy = 0;
  for (const double value : profile) energy += value * value;
  for (size_t shift = 0; shift < sums_.size() && shift < profile.size(); ++shift) {
    double sum = 0;
    for (size_t r = 0; r + shift < profile.size(); ++r) sum += profile[r] * profile[r + shift];
    sums_[shift] += sum / (energy * static_cast<double>(profile.size() - shift));
  }
  return view.grey;
}

// From peak to peak: each narrows where the next is looked for.
double SleeperSpacing::spacing_m() const {
  double low = kShortestM / kCellM;
  double high = kLongestM / kCellM;
  double spacing = 0;
  for (int period = 1; period <= kPeriods; ++period) {
    const auto first = sums_.begin() + std::lround(low * period);
    const auto last = std::min(sums_.begin() + std::lround(high * period), sums_.end() - 2);
    const auto peak = std::max_element(first, last + 1);
    const double bend = *(peak - 1) - 2 * *peak + *(peak + 1);
    const double part = bend < 0 ? 0.5 * (*(peak - 1) - *(peak + 1)) / bend : 0;
    spacing = (static_cast<double>(peak - sums_.begin()) + part) / period;
    low = spacing * (1 - 0.25 / (period + 1));
    high = spacing * (1 + 0.25 / (period + 1));
  }
  return spacing * kCellM;
}

}  // namespace railfix
