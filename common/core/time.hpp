// Time is nanoseconds since the Unix epoch, in a plain 64-bit integer named ..._ns.
#pragma once

#include <chrono>
#include <cstdint>

namespace railfix::core {

constexpr int64_t kNsPerSecond = 1'000'000'000;

/// This host's clock (PTP, chrony or GNSS keep it right).
inline int64_t wall_ns() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::system_clock::now().time_since_epoch())
      .count();
}

/// A clock that never jumps, for periods and time-outs.
inline int64_t monotonic_ns() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::steady_clock::now().time_since_epoch())
      .count();
}

constexpr double seconds(int64_t duration_ns) {
  return static_cast<double>(duration_ns) * 1e-9;
}
constexpr int64_t to_ns(double duration_s) {
  return static_cast<int64_t>(duration_s * 1e9 + (duration_s < 0 ? -0.5 : 0.5));
}

}  // namespace railfix::core
