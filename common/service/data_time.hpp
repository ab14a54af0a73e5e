// What time it is now in data that is played at real pace: anchored by data_clock, carried on by the clock that never
// jumps, so that a host whose clock is set, or is wrong, goes on with the others. Knows no clock.
#pragma once

#include <cstdint>

#include "core/time.hpp"
#include "idl/operation.h"

namespace railfix::service {

class DataTime {
 public:
  /// Who plays at real pace says the time so often: a service that comes back waits no longer for it.
  static constexpr int64_t kPeriodNs = core::kNsPerSecond / 4;

  /// As it comes. Its way to here counts while the two hosts' clocks agree well enough to tell it.
  void hear(const msg::DataClock& clock, int64_t wall_ns, int64_t monotonic_ns) {
    const int64_t way_ns = wall_ns - clock.wall_ns();
    const bool is_way = way_ns >= 0 && way_ns < kLongestWayNs;
    ahead_ns_ = clock.data_ns() + (is_way ? way_ns : 0) - monotonic_ns;
  }
  /// REQUIRES: hear() was called.
  [[nodiscard]] int64_t at(int64_t monotonic_ns) const { return monotonic_ns + ahead_ns_; }

 private:
  static constexpr int64_t kLongestWayNs = core::kNsPerSecond / 2;
  int64_t ahead_ns_ = 0;  // of the monotonic clock
};

}  // namespace railfix::service
