// "Globally at least as good" (GAMAB, EN 50126-2): is one system's figure shown to be no worse than another's?
// One-sided, with a stated confidence and a margin, by a bootstrap over legs, because the errors of one leg belong
// together.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace railfix::compare {

enum class Verdict : uint8_t { at_least_as_good, worse, open };

struct Sample {
  size_t leg = 0;
  double ours = 0;
  double certified = 0;
};

enum class Figure : uint8_t { mean, root_mean_square };

struct RatioResult {
  Verdict verdict = Verdict::open;
  double ratio = 0;  // ours over certified; NaN without samples
  double low = 0;    // one-sided bounds at the confidence each
  double high = 0;
  size_t samples = 0;
  size_t legs = 0;
  double legs_needed = 0;  // for "at least as good" if the ratio stays; infinite when it never would, NaN unless open
};

struct Demand {
  double confidence = 0.95;
  double margin = 0.05;  // at least as good: the ratio is at most 1 + margin
};

/// Samples with a value that is not finite are left out. Fewer than 10 legs give no verdict.
RatioResult compare_ratio(const std::vector<Sample>& samples, Figure figure, const Demand& demand);

/// Legs on which a promise was broken, by one system alone: sign test.
struct BrokenResult {
  Verdict verdict = Verdict::open;
  size_t legs = 0;
  size_t ours = 0;  // legs with a broken promise
  size_t certified = 0;
  double ours_at_most = 0;  // upper bound of our share of broken legs at the confidence (Clopper, Pearson 1934)
};
/// A value above 0 is a broken promise.
BrokenResult compare_broken(const std::vector<Sample>& samples, const Demand& demand);

}  // namespace railfix::compare
