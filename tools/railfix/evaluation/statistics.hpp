// The few figures that say how large a set of errors is.
#pragma once

#include <cstddef>
#include <limits>
#include <vector>

namespace railfix::evaluation {

constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

/// All NaN when there are no values.
struct Summary {
  size_t count = 0;
  double mean = kUnknown;
  double p50 = kUnknown;
  double p95 = kUnknown;
  double max = kUnknown;
};

/// Of the finite ones among the values.
Summary summarise(std::vector<double> values);
/// Root mean square of the finite values; NaN when there are none.
double root_mean_square(const std::vector<double>& values);
/// 100 * part / whole; NaN when whole is 0.
double percent(size_t part, size_t whole);

}  // namespace railfix::evaluation
