#include "evaluation/time_gaps.hpp"

#include <algorithm>

#include "core/time.hpp"
#include "evaluation/statistics.hpp"

namespace railfix::evaluation {

int64_t longest_step_ns(const std::vector<int64_t>& stamps_ns) {
  std::vector<double> steps;
  steps.reserve(stamps_ns.size());
  for (size_t i = 1; i < stamps_ns.size(); ++i) steps.push_back(static_cast<double>(stamps_ns[i] - stamps_ns[i - 1]));
  if (steps.empty()) return core::kNsPerSecond;
  return std::max(core::kNsPerSecond, static_cast<int64_t>(3 * summarise(steps).p50));
}

TimeGaps gaps_in(const std::vector<int64_t>& stamps_ns) {
  const int64_t longest_ns = longest_step_ns(stamps_ns);
  TimeGaps gaps;
  for (size_t i = 1; i < stamps_ns.size(); ++i) {
    const int64_t step_ns = stamps_ns[i] - stamps_ns[i - 1];
    if (step_ns <= longest_ns) continue;
    ++gaps.count;
    if (core::seconds(step_ns) <= gaps.longest_s) continue;
    gaps.longest_s = core::seconds(step_ns);
    gaps.longest_from_ns = stamps_ns[i - 1];
  }
  return gaps;
}

}  // namespace railfix::evaluation
