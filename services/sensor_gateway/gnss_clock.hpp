// When a receiver's position was true, in this host's time. Knows no clock.
#pragma once

#include <cstdint>
#include <optional>

#include "core/device_clock.hpp"

namespace railfix::sensor_gateway {

/// While somebody keeps this host's clock (PTP, NTP) it shows UTC, and so does the receiver's: its own stamp is the
/// best there is. Where nobody does, the stamp comes from the arrival of the reports.
class GnssClock {
 public:
  /// `latency_ns`: from the position to the arrival of its report when nothing delays it.
  explicit GnssClock(int64_t latency_ns) : latency_ns_(latency_ns) {}
  /// Nothing while it is not known: the first reports teach, and two clocks that both claim to be right do not agree
  /// (see contradiction_s). REQUIRES: utc_ns growing, in the order of arrival.
  [[nodiscard]] std::optional<int64_t> stamp_ns(int64_t utc_ns, const core::HostTime& arrival, bool clock_is_kept);
  /// Reports come anew: whether the clocks contradict each other is asked again.
  void connected() { contradiction_s_.reset(); }
  /// How much this host's clock, which is kept, is ahead of the receiver's where the two contradict; nothing otherwise.
  [[nodiscard]] std::optional<double> contradiction_s() const { return contradiction_s_; }

 private:
  int64_t latency_ns_;
  core::DeviceClock clock_;
  std::optional<int64_t> last_utc_ns_;
  int learnt_from_ = 0;
  std::optional<double> contradiction_s_;
};

}  // namespace railfix::sensor_gateway
