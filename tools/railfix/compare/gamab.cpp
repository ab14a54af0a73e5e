#include "compare/gamab.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "core/random.hpp"
#include "evaluation/statistics.hpp"

namespace railfix::compare {

namespace {

constexpr size_t kFewestLegs = 10;
constexpr int kDraws = 4000;
constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

struct Leg {
  double ours = 0;  // sums
  double certified = 0;
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
  for (const auto& [number, leg] : legs) sums.push_back(leg);
  return sums;
}

double ratio_of(const Leg& sum, Figure figure) {
  const double ratio = sum.ours / sum.certified;
  return figure == Figure::root_mean_square ? std::sqrt(ratio) : ratio;
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
  Leg all;
  for (const auto& leg : legs) {
    all.ours += leg.ours;
    all.certified += leg.certified;
  }
  if (legs.empty()) return result;
  result.ratio = ratio_of(all, figure);
  if (legs.size() < kFewestLegs) {
    result.legs_needed = static_cast<double>(kFewestLegs);
    return result;
  }
  core::Random random(1);
  std::vector<double> ratios;
  for (int draw = 0; draw < kDraws; ++draw) {
    Leg sum;
    for (size_t i = 0; i < legs.size(); ++i) {
      const Leg& leg = legs[random.next() % legs.size()];
      sum.ours += leg.ours;
      sum.certified += leg.certified;
    }
    ratios.push_back(ratio_of(sum, figure));
  }
  std::sort(ratios.begin(), ratios.end());
  // With few legs a percentile bootstrap is too sure; widened so that the test of the confidence holds at 20 and 40
  // legs.
  const double widened = 1 + 10.0 / static_cast<double>(legs.size());
  const auto bound = [&](double share) {
    return result.ratio * std::pow(evaluation::quantile(ratios, share) / result.ratio, widened);
  };
  result.low = bound(1 - demand.confidence);
  result.high = bound(demand.confidence);
  const double limit = 1 + demand.margin;
  if (result.high <= limit) {
    result.verdict = Verdict::at_least_as_good;
  } else if (result.low > limit) {
    result.verdict = Verdict::worse;
  } else {  // the bound comes nearer with the root of the number of legs
    const double to_bound = std::log(result.high / result.ratio);
    const double to_limit = std::log(limit / result.ratio);
    result.legs_needed = to_limit > 0 ? std::ceil(static_cast<double>(legs.size()) * std::pow(to_bound / to_limit, 2))
                                      : std::numeric_limits<double>::infinity();
  }
  return result;
}

BrokenResult compare_broken(const std::vector<Sample>& samples, const Demand& demand) {
  struct Broken {
    bool ours = false;
    bool certified = false;
  };
  std::map<size_t, Broken> legs;
  for (const auto& sample : samples) {
    auto& leg = legs[sample.leg];
    leg.ours |= sample.ours > 0;
    leg.certified |= sample.certified > 0;
  }
  BrokenResult result;
  result.legs = legs.size();
  size_t only_ours = 0;
  size_t only_certified = 0;
  for (const auto& [number, leg] : legs) {
    result.ours += leg.ours;
    result.certified += leg.certified;
    only_ours += leg.ours && !leg.certified;
    only_certified += leg.certified && !leg.ours;
  }
  result.ours_at_most = upper_share(result.ours, result.legs, demand.confidence);
  if (result.legs < kFewestLegs) return result;
  const size_t alone = only_ours + only_certified;
  if (only_ours <= only_certified) {
    result.verdict = Verdict::at_least_as_good;
  } else if (binomial_up_to(only_certified, alone, 0.5) <= 1 - demand.confidence) {
    result.verdict = Verdict::worse;
  }
  return result;
}

}  // namespace railfix::compare
