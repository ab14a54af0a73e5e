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

}  // namespace railfix::core
