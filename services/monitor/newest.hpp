// A sample's place in the page: the newest one of its topic, and when it came.
#pragma once

#include <optional>

#include "core/time.hpp"
#include "monitor/train_watch.hpp"

namespace railfix::monitor {

template <class T>
struct Newest {
  std::optional<T> sample;
  int64_t arrived_ns = 0;  // monotonic: a clock that is set makes nothing old or young

  int64_t received_ns = 0;  // the same by the wall clock

  void take(const Arrived& arrived) {
    sample = arrived.as<T>();
    received_ns = arrived.info.received_ns;
    arrived_ns = arrived.info.arrived_ns;
  }
  [[nodiscard]] double age_s(int64_t now_ns) const { return core::seconds(now_ns - arrived_ns); }
  /// How old it was already when it came, by its stamp. Says nothing of played data.
  [[nodiscard]] double behind_s() const { return core::seconds(received_ns - sample->stamp_ns()); }
};

}  // namespace railfix::monitor
