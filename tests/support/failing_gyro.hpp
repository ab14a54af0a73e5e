// A gyro that fails: stays at its last value, has another constant error, or more noise.
#pragma once

#include <cstdint>

#include "core/random.hpp"

namespace railfix::testing {

enum class GyroFault : uint8_t { none, stuck, bias, noise };

class FailingGyro {
 public:
  /// size_rps: the error, or the noise of a sample.
  FailingGyro(GyroFault fault, double size_rps) : fault_(fault), size_rps_(size_rps) {}
  /// What it says of this rate.
  double told_rps(double rate_rps, bool fails, core::Random& random) {
    if (!fails || fault_ == GyroFault::none) return last_rps_ = rate_rps;
    if (fault_ == GyroFault::stuck) return last_rps_;
    return rate_rps + (fault_ == GyroFault::noise ? random.normal(0, size_rps_) : size_rps_);
  }

 private:
  GyroFault fault_;
  double size_rps_;
  double last_rps_ = 0;
};

}  // namespace railfix::testing
