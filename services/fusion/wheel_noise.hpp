// How much the wheel's readings scatter. The speed between two readings jumps when the wheel begins to slip, once; it
// jumps from sample to sample when the readings themselves are noisy (a loose sensor, a bad cable, stamps that err).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace railfix::fusion {

/// A plain value. Feed it every reading in the order of the stamps.
class WheelNoise {
 public:
  void add(int64_t stamp_ns, double wheel_m);
  /// One sigma of a reading (m), from the median of the last jumps, so that single ones do not matter; 0 while there
  /// are too few.
  [[nodiscard]] double sigma_m() const;

 private:
  static constexpr size_t kJumps = 15;
  std::array<float, kJumps> jumps_m_{};
  size_t count_ = 0;
  int64_t last_ns_ = 0;
  double last_m_ = 0;
  double step_s_ = 0;  // to the last reading from the one before; 0 = there is none
  double step_m_ = 0;
};

}  // namespace railfix::fusion
