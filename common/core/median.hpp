// The median as a measure of scatter that outliers do not move.
#pragma once

namespace railfix::core {

/// Sigma of a normal distribution over the median of its absolute values.
inline constexpr double kSigmaOfMedian = 1.4826;

}  // namespace railfix::core
