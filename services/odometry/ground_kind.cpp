#include "odometry/ground_kind.hpp"

#include <algorithm>
#include <cmath>

namespace railfix::odometry {
namespace {

constexpr double kWindowM = 1.4;     // holds two sleepers and what is between them
constexpr int kEdgeRows = 0;         // that a sleeper's edge spreads over
constexpr double kApartM = 0.06;     // ballast so near to a sleeper is not used
constexpr float kFewestGrey = 0.5F;  // roughness of a noiseless row that is as good as smooth
constexpr float kClearlyRougher = 1.7F;

// Root mean square difference of neighbours along the row, smoothed over three rows.
std::vector<float> roughness(const vision::TopView& view) {
  const auto rows = static_cast<size_t>(view.grey.rows);
  std::vector<float> squared(rows, 0.0F);
  for (size_t r = 0; r < rows; ++r) {
    const auto* line = view.grey.ptr<float>(static_cast<int>(r));
    float sum = 0;
    for (int c = 1; c < view.grey.cols; ++c) sum += (line[c] - line[c - 1]) * (line[c] - line[c - 1]);
    squared[r] = sum / static_cast<float>(view.grey.cols - 1);
  }
  std::vector<float> smooth(rows, 0.0F);
  for (size_t r = 1; r + 1 < rows; ++r) smooth[r] = std::sqrt((squared[r - 1] + squared[r] + squared[r + 1]) / 3.0F);
  return smooth;
}

}  // namespace

std::vector<Ground> find_ground(const vision::TopView& view, const vision::Sheet& sheet) {
  const std::vector<float> rough = roughness(view);
  const int rows = sheet.rows;
  const int half = static_cast<int>(0.5 * kWindowM / sheet.cell_m);
  std::vector<uint8_t> ballast(static_cast<size_t>(rows), 0);
  std::vector<float> window;
  // The limit between rough and smooth changes slowly with distance: once every few rows is enough.
  constexpr int kStride = 8;
  for (int begin = 0; begin < rows; begin += kStride) {
    window.clear();
    for (int r = std::max(0, begin - half); r < std::min(rows, begin + half); ++r) {
      if (view.row_seen[static_cast<size_t>(r)] != 0) window.push_back(rough[static_cast<size_t>(r)]);
    }
    if (window.size() < static_cast<size_t>(half)) continue;
    const auto share = [&window](double part) {
      const auto at = window.begin() + static_cast<std::ptrdiff_t>(part * static_cast<double>(window.size() - 1));
      std::nth_element(window.begin(), at, window.end());
      return std::max(*at, kFewestGrey);
    };
    const float smooth = share(0.2);
    const float coarse = share(0.8);
    if (coarse < kClearlyRougher * smooth) continue;
    const float limit = std::sqrt(smooth * coarse);
    for (int r = begin; r < std::min(rows, begin + kStride); ++r) {
      ballast[static_cast<size_t>(r)] = rough[static_cast<size_t>(r)] > limit ? 1 : 0;
    }
  }
  std::vector<Ground> ground(static_cast<size_t>(rows), Ground::sleeper);
  const auto any_smooth = [&](int row, int reach) {
    for (int k = std::max(0, row - reach); k <= std::min(rows - 1, row + reach); ++k) {
      if (ballast[static_cast<size_t>(k)] == 0) return true;
    }
    return false;
  };
  const int apart = std::max(kEdgeRows + 1, static_cast<int>(std::lround(kApartM / sheet.cell_m)));
  for (int r = 0; r < rows; ++r) {
    if (!any_smooth(r, apart)) {
      ground[static_cast<size_t>(r)] = Ground::ballast;
    } else if (!any_smooth(r, kEdgeRows)) {
      ground[static_cast<size_t>(r)] = Ground::mixed;
    }
  }
  return ground;
}

}  // namespace railfix::odometry
