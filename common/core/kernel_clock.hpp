// What the kernel knows of the keeper of this computer's clock: chronyd, or ptp4l with phc2sys.
#pragma once

#include <sys/timex.h>

#include <cstdint>
#include <optional>

namespace railfix::core {

/// How far off the clock can be at most, by its keeper's last word; nothing when nobody keeps it (adjtimex(2)).
inline std::optional<int64_t> clock_error_ns() {
  timex clock{};
  const int state = adjtimex(&clock);
  if (state < 0 || state == TIME_ERROR || (clock.status & STA_UNSYNC) != 0) return std::nullopt;
  return int64_t{clock.maxerror} * 1000;
}

/// Well enough for stamps of two clocks to be compared. Without its keeper the kernel's bound grows by half a
/// millisecond a second, so an end is told after three minutes.
inline bool is_kept(std::optional<int64_t> max_error_ns) {
  constexpr int64_t kMostNs = 100'000'000;  // 3 m at 30 m/s
  return max_error_ns && *max_error_ns <= kMostNs;
}

}  // namespace railfix::core
