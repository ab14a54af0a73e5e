// A device's own clock (of a camera, a sensor) in the host's time. A message takes a least time to arrive and sometimes
// longer, so the lower edge of arrival less device time shows how the clocks differ and drift; late arrivals do not
// move the stamps, even where a link that was cut brings seconds of them at once. A host clock that is set moves them
// at once.
#pragma once

#include <cstdint>
#include <deque>
#include <optional>

#include "core/host_time.hpp"

namespace railfix::core {

class DeviceClock {
 public:
  /// Host time (wall) at which a message of this device time arrives when nothing delays it. Strictly growing while the
  /// host's clock is not set back. A device clock that was set begins anew, which takes 3 s where it was set back by
  /// less than the device was silent. REQUIRES: in the order of arrival.
  int64_t host_ns(int64_t device_ns, const HostTime& arrival);

 private:
  struct Lowest {  // of one window
    int64_t device_ns;
    int64_t offset_ns;
  };
  /// Of the device's clock, not of the message's way.
  [[nodiscard]] bool is_set_anew(int64_t device_ns, int64_t arrival_ns);
  void add(int64_t device_ns, int64_t offset_ns);
  void fit_drift();
  [[nodiscard]] int64_t offset_ns(int64_t device_ns) const;
  std::deque<Lowest> lowest_;  // of arrivals on the host's monotonic clock
  int64_t window_begin_ns_ = 0;
  double drift_ = 0;
  std::optional<int64_t> last_device_ns_;
  std::optional<int64_t> late_since_ns_;  // arrival of the first of the late ones
  int64_t last_host_ns_ = INT64_MIN;      // monotonic, too
};

}  // namespace railfix::core
