#include "odometry/ground_kind.hpp"

#include <algorithm>
#include <cmath>

namespace railfix::odometry {
namespace {

constexpr double kWindowM = 1.4;     // holds two sleepers and what is between them
constexpr int kStride = 8;           // rows between limits
constexpr double kApartM = 0.06;     // ballast so near to a sleeper is not used, nor a sleeper so near to its front
constexpr float kFewestGrey = 0.5F;  // roughness of a noiseless row that is as good as smooth
constexpr float kClearlyRougher = 1.7F;

}  // namespace

void GroundFinder::measure_roughness(const vision::TopView& view) {
  const auto rows = static_cast<size_t>(view.grey.rows);
  squared_.resize(rows);
  for (size_t r = 0; r < rows; ++r) {
    const auto* line = view.grey.ptr<float>(static_cast<int>(r));
    float sum = 0;
    for (int c = 1; c < view.grey.cols; ++c) sum += (line[c] - line[c - 1]) * (line[c] - line[c - 1]);
    squared_[r] = sum / static_cast<float>(view.grey.cols - 1);
  }
  roughness_.assign(rows, 0.0F);
  for (size_t r = 1; r + 1 < rows; ++r)
    roughness_[r] = std::sqrt((squared_[r - 1] + squared_[r] + squared_[r + 1]) / 3.0F);
}

// The limit between rough and smooth changes slowly with distance: once every few rows is enough.
void GroundFinder::mark_ballast(const vision::TopView& view, int half_window) {
  const int rows = view.grey.rows;
  ballast_.assign(static_cast<size_t>(rows), 0);
  for (int begin = 0; begin < rows; begin += kStride) {
    window_.clear();
    for (int r = std::max(0, begin - half_window); r < std::min(rows, begin + half_window); ++r) {
      if (view.row_seen[static_cast<size_t>(r)] != 0) window_.push_back(roughness_[static_cast<size_t>(r)]);
    }
    if (window_.size() < static_cast<size_t>(half_window)) continue;
    const auto share = [this](double part) {
      const auto at = window_.begin() + static_cast<std::ptrdiff_t>(part * static_cast<double>(window_.size() - 1));
      std::nth_element(window_.begin(), at, window_.end());
      return std::max(*at, kFewestGrey);
    };
    const float smooth = share(0.2);
    const float coarse = share(0.8);
    if (coarse < kClearlyRougher * smooth) continue;
    const float limit = std::sqrt(smooth * coarse);
    for (int r = begin; r < std::min(rows, begin + kStride); ++r)
      ballast_[static_cast<size_t>(r)] = roughness_[static_cast<size_t>(r)] > limit ? 1 : 0;
  }
}

bool GroundFinder::any(uint8_t ballast, int first, int last) const {
  const auto begin = ballast_.begin() + std::max(0, first);
  const auto end = ballast_.begin() + std::min(static_cast<int>(ballast_.size()), last + 1);
  return std::find(begin, end, ballast) != end;
}

void GroundFinder::find(const vision::TopView& view, const vision::Sheet& sheet, std::vector<Ground>& out) {
  measure_roughness(view);
  mark_ballast(view, static_cast<int>(0.5 * kWindowM / sheet.cell_m));
  out.assign(static_cast<size_t>(sheet.rows), Ground::sleeper);
  const int apart = std::max(1, static_cast<int>(std::lround(kApartM / sheet.cell_m)));
  for (int r = 0; r < sheet.rows; ++r) {
    if (ballast_[static_cast<size_t>(r)] != 0) {
      out[static_cast<size_t>(r)] = any(0, r - apart, r + apart) ? Ground::mixed : Ground::ballast;
    } else if (any(1, r - apart, r - 1)) {
      out[static_cast<size_t>(r)] = Ground::mixed;  // the front face, smooth as the top, goes down to the stones
    }
  }
}

}  // namespace railfix::odometry
