#include "evaluation/statistics.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace railfix::evaluation {

double quantile(const std::vector<double>& sorted, double share) {
  const double rank = share * static_cast<double>(sorted.size() - 1);
  const auto below = static_cast<size_t>(rank);
  const size_t above = std::min(below + 1, sorted.size() - 1);
  return sorted[below] + (rank - static_cast<double>(below)) * (sorted[above] - sorted[below]);
}

Summary summarise(std::vector<double> values) {
  std::erase_if(values, [](double value) { return !std::isfinite(value); });
  Summary summary;
  summary.count = values.size();
  if (values.empty()) return summary;
  std::sort(values.begin(), values.end());
  summary.mean = std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
  summary.p50 = quantile(values, 0.5);
  summary.p95 = quantile(values, 0.95);
  summary.max = values.back();
  return summary;
}

double root_mean_square(const std::vector<double>& values) {
  double sum = 0;
  size_t count = 0;
  for (const double value : values) {
    if (!std::isfinite(value)) continue;
    sum += value * value;
    ++count;
  }
  return count == 0 ? kUnknown : std::sqrt(sum / static_cast<double>(count));
}

double percent(size_t part, size_t whole) {
  return whole == 0 ? kUnknown : 100.0 * static_cast<double>(part) / static_cast<double>(whole);
}

}  // namespace railfix::evaluation
