// Both of this host's clocks together.
#pragma once

#include "core/time.hpp"

namespace railfix::core {

/// Both clocks at one moment: their difference changes only where this host's clock is set.
struct HostTime {
  int64_t wall_ns = 0;
  int64_t monotonic_ns = 0;
};
inline HostTime host_time() {
  constexpr int64_t kTogetherNs = 100'000;  // else this thread had to wait between the two
  for (int attempt = 0;; ++attempt) {
    const int64_t before_ns = monotonic_ns();
    const int64_t now_ns = wall_ns();
    const int64_t after_ns = monotonic_ns();
    if (after_ns - before_ns < kTogetherNs || attempt == 3) return {now_ns, before_ns + (after_ns - before_ns) / 2};
  }
}

}  // namespace railfix::core
