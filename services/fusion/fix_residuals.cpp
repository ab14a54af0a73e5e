#include "fusion/fix_residuals.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/median.hpp"
#include "fusion/jump_evidence.hpp"

namespace railfix::fusion {
namespace {

constexpr size_t kLegs = 2;
constexpr double kShortestLegM = 200.0;  // one that is shorter tells of the landmarks at its ends
constexpr double kMostPerM = 0.03;

}  // namespace

void FixResiduals::add(uint32_t landmark, double residual_m, double sigmas, double way_m) {
  if (landmark != 0 && std::exchange(landmark_, landmark) == landmark) return;
  std::rotate(last_.begin(), last_.end() - 1, last_.end());
  last_.front() = {std::abs(residual_m), sigmas, way_m};
  count_ = std::min(count_ + 1, kFixes);
}

double FixResiduals::scatter_m() const {
  const auto median = [this](double Residual::*of) {
    auto sorted = last_;
    std::ranges::nth_element(sorted, sorted.begin() + kFixes / 2, {}, of);
    return sorted[kFixes / 2].*of;
  };
  // Three of five that keep their word are so far off in 2 of 100,000 cases.
  if (count_ < kFixes || median(&Residual::sigmas) < kUnlikelySigmas) return 0;
  return core::kSigmaOfMedian * median(&Residual::metres);
}

double FixResiduals::error_per_m() const {
  double most = 0;
  for (size_t i = 0; i < kLegs; ++i) {
    const auto& leg = last_[i];
    if (leg.sigmas >= kUnlikelySigmas) most = std::max(most, leg.metres / std::max(leg.way_m, kShortestLegM));
  }
  return std::min(most, kMostPerM);
}

}  // namespace railfix::fusion
