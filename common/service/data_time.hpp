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

  /// As the newest clock comes. Its way to here counts while the two hosts' clocks agree well enough to tell it.
  DataTime(const msg::DataClock& clock, int64_t wall_ns, int64_t monotonic_ns)
      : stands_(clock.lock_step() != 0 || clock.ended() != 0) {
    const int64_t way_ns = wall_ns - clock.wall_ns();
    const bool is_way = way_ns >= 0 && way_ns < kLongestWayNs;
    ahead_ns_ = clock.data_ns() + (is_way ? way_ns : 0) - monotonic_ns;
  }
  /// Where it stands(): as if it went on.
  [[nodiscard]] int64_t at(int64_t monotonic_ns) const { return monotonic_ns + ahead_ns_; }
  /// It does not go on by itself: in lock step with the data only, or not at all behind their end.
  [[nodiscard]] bool stands() const { return stands_; }

 private:
  static constexpr int64_t kLongestWayNs = core::kNsPerSecond / 2;
  int64_t ahead_ns_ = 0;  // of the monotonic clock
  bool stands_ = false;
};

}  // namespace railfix::service
