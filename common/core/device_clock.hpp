// A device's own clock (of a camera, a sensor) in the host's time. A message takes a least time to arrive and sometimes
// longer, so the lower edge of arrival less device time shows how the clocks differ and drift; late arrivals do not
// move the stamps.
#pragma once

#include <cstdint>
#include <deque>
#include <optional>

namespace railfix::core {

class DeviceClock {
 public:
  /// Host time at which a message of this device time arrives when nothing delays it. Strictly growing, but for a
  /// device clock that was set back, which begins anew. REQUIRES: in the order of arrival.
  int64_t host_ns(int64_t device_ns, int64_t arrival_ns);
  [[nodiscard]] double drift_ppm() const { return drift_ * 1e6; }

 private:
  struct Lowest {  // of one window
    int64_t device_ns;
    int64_t offset_ns;
  };
  void add(int64_t device_ns, int64_t offset_ns);
  void fit_drift();
  [[nodiscard]] int64_t offset_ns(int64_t device_ns) const;
  std::deque<Lowest> lowest_;
  int64_t window_begin_ns_ = 0;
  double drift_ = 0;
  std::optional<int64_t> last_device_ns_;
  int64_t last_host_ns_ = INT64_MIN;
};

}  // namespace railfix::core
