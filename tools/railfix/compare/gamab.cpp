#include "compare/gamab.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <utility>

#include "core/random.hpp"

namespace railfix::compare {

namespace {

constexpr double kFewestDraws = 1999;
constexpr double kDrawsBeyondBound = 20;
constexpr double kUnseenOverWorst = 2;
constexpr double kMostLegDraws = 5e5;  // spent on one more guess of how many legs are needed
constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

struct Leg {
  double ours = 0;  // sums
  double certified = 0;
  Leg operator+(const Leg& other) const { return {ours + other.ours, certified + other.certified}; }
  Leg operator*(double weight) const { return {ours * weight, certified * weight}; }
};

std::vector<Leg> sums_of_legs(const std::vector<Sample>& samples, Figure figure, size_t& used) {
  std::map<size_t, Leg> legs;
  for (const auto& sample : samples) {
    if (!std::isfinite(sample.ours) || !std::isfinite(sample.certified)) continue;
    ++used;
    const bool square = figure == Figure::root_mean_square;
    legs[sample.leg].ours += square ? sample.ours * sample.ours : sample.ours;
    legs[sample.leg].certified += square ? sample.certified * sample.certified : sample.certified;
  }
  std::vector<Leg> sums;
  sums.reserve(legs.size());
  for (const auto& [number, leg] : legs) sums.push_back(leg);
  return sums;
}

double ratio_of(const Leg& sum, Figure figure) {
  const double ratio = sum.ours / sum.certified;
  return figure == Figure::root_mean_square ? std::sqrt(ratio) : ratio;
}

struct Bounds {
  double low = 0;
  double high = 0;
};

/// Ratios of random subsets, every leg in or out by a throw of a coin.
Leg random_subset(const std::vector<Leg>& legs, core::Random& random) {
  Leg sum;
  while (sum.ours == 0 && sum.certified == 0) {
    uint64_t coins = 0;
    for (size_t i = 0; i < legs.size(); ++i) {
      if (i % 64 == 0) coins = random.next();
      if ((coins >> (i % 64) & 1U) != 0) sum = sum + legs[i];
    }
  }
  return sum;
}

double random_weight(core::Random& random) {
  return -std::log1p(-random.uniform());
}

size_t draws_for(double confidence) {
  return static_cast<size_t>(std::max(kFewestDraws, std::ceil(kDrawsBeyondBound / (1 - confidence))));
}

Bounds bounds_of(const std::vector<Leg>& legs, Figure figure, double confidence) {
  const size_t draws = draws_for(confidence);
  Leg worst;
  for (const auto& leg : legs) worst = {std::max(worst.ours, leg.ours), std::max(worst.certified, leg.certified)};
  core::Random random(1);
  std::vector<double> subsets;
  std::vector<double> pessimist;
  std::vector<double> optimist;
  const double unseen_over_worst = figure == Figure::share ? 1 : kUnseenOverWorst;
  for (size_t draw = 0; draw < draws; ++draw) {
    subsets.push_back(ratio_of(random_subset(legs, random), figure));
    Leg sum;
    for (const auto& leg : legs) sum = sum + leg * random_weight(random);
    const double unseen = unseen_over_worst * random_weight(random);
    pessimist.push_back(ratio_of({sum.ours + unseen * worst.ours, sum.certified}, figure));
    optimist.push_back(ratio_of({sum.ours, sum.certified + unseen * worst.certified}, figure));
  }
  for (auto* ratios : {&subsets, &pessimist, &optimist}) std::sort(ratios->begin(), ratios->end());
  const auto beyond = static_cast<size_t>((1 - confidence) * static_cast<double>(draws + 1) + 1e-9);
  return {std::min(subsets[beyond - 1], optimist[beyond - 1]),
          std::max(subsets[draws - beyond], pessimist[draws - beyond])};
}

/// How many legs like these bring the upper bound to the limit: tried on the same ones twice, four times, ... as often,
/// because the bound comes nearer with their number where the unseen leg decides, with its root where the scatter does.
double legs_needed(std::vector<Leg> legs, Figure figure, const Demand& demand, double ratio, double high) {
  const double to_limit = std::log((1 + demand.margin) / ratio);
  if (!(to_limit > 0)) return std::numeric_limits<double>::infinity();
  const double draws = static_cast<double>(draws_for(demand.confidence));
  double to_bound = std::log(high / ratio);
  for (;;) {
    const auto count = static_cast<double>(legs.size());
    const double before = to_bound;
    legs.reserve(2 * legs.size());
    legs.insert(legs.end(), legs.begin(), legs.end());
    to_bound = std::log(bounds_of(legs, figure, demand.confidence).high / ratio);
    if (to_bound > to_limit && count * draws < kMostLegDraws) continue;
    if (!std::isfinite(before)) return std::isfinite(to_bound) ? 2 * count : kUnknown;
    const double power = std::clamp(std::log2(before / to_bound), 0.5, 1.0);
    return std::ceil(count * std::pow(before / to_limit, 1 / power));
  }
}

/// Probability of at most k heads in n throws.
double binomial_up_to(size_t k, size_t n, double p) {
  double sum = 0;
  for (size_t i = 0; i <= k; ++i) {
    const auto x = static_cast<double>(i);
    const auto all = static_cast<double>(n);
    sum += std::exp(std::lgamma(all + 1) - std::lgamma(x + 1) - std::lgamma(all - x + 1) + x * std::log(p) +
                    (all - x) * std::log1p(-p));
  }
  return sum;
}

double upper_share(size_t k, size_t n, double confidence) {
  if (n == 0 || k >= n) return 1;
  double low = 0;
  double high = 1;
  for (int i = 0; i < 60; ++i) {
    const double middle = 0.5 * (low + high);
    (binomial_up_to(k, n, middle) > 1 - confidence ? low : high) = middle;
  }
  return high;
}

}  // namespace

RatioResult compare_ratio(const std::vector<Sample>& samples, Figure figure, const Demand& demand) {
  RatioResult result{Verdict::open, kUnknown, kUnknown, kUnknown, 0, 0, kUnknown};
  const auto legs = sums_of_legs(samples, figure, result.samples);
  result.legs = legs.size();
  if (legs.empty()) return result;
  Leg all;
  for (const auto& leg : legs) all = all + leg;
  const bool nothing = all.ours == 0 && all.certified == 0;
  if (nothing && figure == Figure::share) return result;
  result.ratio = nothing ? 1 : ratio_of(all, figure);
  if (legs.size() < kFewestLegs) return result;
  if (nothing) {  // no error at all is as good as none
    result.low = result.high = 1;
    result.verdict = Verdict::at_least_as_good;
    return result;
  }
  const auto bounds = bounds_of(legs, figure, demand.confidence);
  result.low = bounds.low;
  result.high = bounds.high;
  const double limit = 1 + demand.margin;
  if (result.high <= limit) {
    result.verdict = Verdict::at_least_as_good;
  } else if (result.low > limit) {
    result.verdict = Verdict::worse;
  } else {
    result.legs_needed = legs_needed(legs, figure, demand, result.ratio, result.high);
  }
  return result;
}

RatioResult compare_share(const std::vector<Sample>& samples, const Demand& demand) {
  auto swapped = samples;
  for (auto& sample : swapped) std::swap(sample.ours, sample.certified);
  return compare_ratio(swapped, Figure::share, demand);
}

BrokenResult compare_broken(const std::vector<Sample>& samples, const Demand& demand) {
  struct Leg {
    bool promised = false;
    bool broken = false;
    void add(double value) {
      promised |= std::isfinite(value);
      broken |= value > 0;
    }
  };
  std::map<size_t, std::pair<Leg, Leg>> legs;
  for (const auto& sample : samples) {
    auto& [ours, certified] = legs[sample.leg];
    ours.add(sample.ours);
    certified.add(sample.certified);
  }
  BrokenResult result;
  size_t only_ours = 0;
  size_t only_certified = 0;
  for (const auto& [number, leg] : legs) {
    const auto& [ours, certified] = leg;
    result.ours.legs += ours.promised;
    result.ours.broken += ours.broken;
    result.certified.legs += certified.promised;
    result.certified.broken += certified.broken;
    if (!ours.promised || !certified.promised) continue;
    only_ours += ours.broken && !certified.broken;
    only_certified += certified.broken && !ours.broken;
  }
  result.ours_at_most = upper_share(result.ours.broken, result.ours.legs, demand.confidence);
  if (result.ours.legs < kFewestLegs) return result;
  const size_t alone = only_ours + only_certified;
  if (only_ours <= only_certified) {
    if (result.ours_at_most <= demand.broken_at_most) result.verdict = Verdict::at_least_as_good;
  } else if (binomial_up_to(only_certified, alone, 0.5) <= 1 - demand.confidence) {
    result.verdict = Verdict::worse;
  }
  return result;
}

}  // namespace railfix::compare
