// The value that a share of all stays below.
#pragma once

#include <algorithm>
#include <cstddef>
#include <limits>

namespace railfix::core {

/// Linear between the two nearest ranks; NaN without values. REQUIRES: sorted, finite, share in [0, 1].
template <class Values>
double quantile(const Values& sorted, double share) {
  if (sorted.empty()) return std::numeric_limits<double>::quiet_NaN();
  const double rank = share * static_cast<double>(sorted.size() - 1);
  const auto below = static_cast<size_t>(rank);
  const size_t above = std::min(below + 1, sorted.size() - 1);
  const double low = sorted[below];
  return low + (rank - static_cast<double>(below)) * (sorted[above] - low);
}

}  // namespace railfix::core
