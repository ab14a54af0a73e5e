// "Globally at least as good" (GAMAB, EN 50126-2): is one system's figure shown to be no worse than another's?
// One-sided, with a stated confidence and a margin, over legs, because the errors of one leg belong together.
//
// It compares performance, a non-inferiority test with a margin of 5 % on accuracy and a 95 % bound for the share of
// legs outside the interval, and is no risk acceptance by EN 50126: it knows no hazards and no rates of them.
//
// A bound is the farther one of two:
// - Ratios of random subsets of the legs are typical values (Hartigan, "Using subsample values as typical values", JASA
//   64, 1969): the true ratio R is as likely in one gap between the sorted ones as in any other. Exact for
//   any number of legs and tails however heavy, where ours - R certified of a leg is as likely as its negative, as it
//   is when both systems' errors are distributed alike but for their size.
// - Random weights on the legs and on one more that was not seen, twice as bad as the worst one seen (Gaffke, "Three
//   test statistics for a nonparametric one-sided hypothesis on the mean of a nonnegative variable", Math. Methods
//   Statist. 14, 2005, whose bound puts the unseen one at the end of the range). For systems whose errors are not
//   alike. A share ends at all reports: there the unseen one is the longest seen, and has nothing of ours.
// No bound can hold against a failure so rare that the legs at hand likely do not show it: see compare_broken.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace railfix::compare {

constexpr size_t kFewestLegs = 10;  // for a verdict

enum class Verdict : uint8_t { at_least_as_good, worse, open };

struct Sample {
  size_t leg = 0;
  double ours = 0;
  double certified = 0;
};

enum class Figure : uint8_t { mean, root_mean_square, share };

struct RatioResult {
  Verdict verdict = Verdict::open;
  double ratio = 0;  // ours over certified; NaN without samples
  double low = 0;    // one-sided bounds at the confidence each
  double high = 0;
  size_t samples = 0;
  size_t legs = 0;
  double legs_needed = 0;  // about, for "at least as good" if all go on like these; infinite when it never would, NaN
                           // unless open and with too few legs to tell
};

struct Demand {
  double confidence = 0.95;
  double margin = 0.05;          // at least as good: the ratio is at most 1 + margin
  double broken_at_most = 0.05;  // ... and so large a share of our legs at most has a broken promise
};

/// Samples with a value that is not finite are left out. Fewer than kFewestLegs give no verdict.
RatioResult compare_ratio(const std::vector<Sample>& samples, Figure figure, const Demand& demand);

/// Which share of the reports had what both should have: certified over ours, so that more is worse here, too. A value
/// is 1 where it was there, else 0.
RatioResult compare_share(const std::vector<Sample>& samples, const Demand& demand);

/// Legs on which a promise was broken, by one system alone: sign test, over legs on which both promised. At least as
/// good needs a shown bound, too: no broken leg of few shows nothing.
struct BrokenResult {
  Verdict verdict = Verdict::open;
  struct Side {
    size_t broken = 0;  // legs with a broken promise
    size_t legs = 0;    // with any promise
  };
  Side ours;
  Side certified;
  double ours_at_most = 0;  // upper bound of our share of broken legs at the confidence (Clopper, Pearson 1934)
};
/// A value above 0 is a broken promise, 0 a kept one, NaN none.
BrokenResult compare_broken(const std::vector<Sample>& samples, const Demand& demand);

}  // namespace railfix::compare
