// A grid of cells over the plane, to find what lies near to what.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <cstdint>

namespace railfix::track {

/// Calls `use` with the number of every cell (100 m) that the box touches. A number may stand for two cells far apart.
template <class Use>
void for_cells(const Eigen::Vector2d& low, const Eigen::Vector2d& high, const Use& use) {
  const auto cell = [](double value_m) { return static_cast<int64_t>(std::floor(value_m / 100.0)); };
  for (int64_t x = cell(low.x()); x <= cell(high.x()); ++x) {
    for (int64_t y = cell(low.y()); y <= cell(high.y()); ++y) use(x * 4'000'037 + y);
  }
}

constexpr double kLongestSegmentM = 5000;  // of a drawn line; longer ones are mistakes

}  // namespace railfix::track
