#include "evaluation/statistics.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "core/quantile.hpp"

namespace railfix::evaluation {

Summary summarise(std::vector<double> values) {
  std::erase_if(values, [](double value) { return !std::isfinite(value); });
  Summary summary;
  summary.count = values.size();
  if (values.empty()) return summary;
  std::sort(values.begin(), values.end());
  summary.mean = std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
  summary.p50 = core::quantile(values, 0.5);
  summary.p95 = core::quantile(values, 0.95);
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
