// How often, and since when, a sensor has said the same: one that is stuck repeats itself to the last digit.
#pragma once

#include <cstdint>
#include <limits>

#include "core/time.hpp"

namespace railfix::core {

class Repeated {
 public:
  void add(double value, int64_t stamp_ns) {
    count_ = value == value_ ? count_ + 1 : 0;
    if (count_ == 0 || stamp_ns < last_ns_) since_ns_ = stamp_ns;  // a clock may have been set back
    value_ = value;
    last_ns_ = stamp_ns;
  }
  /// So many times behind the first, and for so long.
  [[nodiscard]] bool lasts(int count, double time_s) const {
    return count_ >= count && seconds(last_ns_ - since_ns_) >= time_s;
  }
  /// The last value; NaN before the first one.
  [[nodiscard]] double value() const { return value_; }
  [[nodiscard]] int count() const { return count_; }
  [[nodiscard]] int64_t since_ns() const { return since_ns_; }

 private:
  double value_ = std::numeric_limits<double>::quiet_NaN();
  int count_ = 0;
  int64_t since_ns_ = 0;
  int64_t last_ns_ = 0;
};

}  // namespace railfix::core
