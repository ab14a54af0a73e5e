// Samples of which only their mean over a period is used.
#pragma once

#include <cstdint>
#include <optional>

#include "core/time.hpp"

namespace railfix::fusion {

/// A plain value.
class PeriodMean {
 public:
  /// A sample of that stamp begins a new period: it is the first one, or some were missing before it.
  [[nodiscard]] bool begins(int64_t stamp_ns) const {
    return count_ == 0 || core::seconds(stamp_ns - last_ns_) > kPauseS;
  }
  /// Gives the mean when the period is complete.
  std::optional<double> add(int64_t stamp_ns, double value, double period_s) {
    if (begins(stamp_ns)) {
      *this = {};
      since_ns_ = stamp_ns;
    }
    last_ns_ = stamp_ns;
    sum_ += value;
    ++count_;
    if (core::seconds(stamp_ns - since_ns_) < period_s) return std::nullopt;
    const double mean = sum_ / count_;
    *this = {};
    return mean;
  }

 private:
  static constexpr double kPauseS = 0.5;
  int64_t since_ns_ = 0;
  int64_t last_ns_ = 0;
  double sum_ = 0;
  int count_ = 0;
};

}  // namespace railfix::fusion
