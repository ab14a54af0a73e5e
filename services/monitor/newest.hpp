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

  void take(const Arrived& arrived) {
    sample = arrived.as<T>();
    arrived_ns = arrived.info.arrived_ns;
  }
  [[nodiscard]] double age_s(int64_t now_ns) const { return core::seconds(now_ns - arrived_ns); }
};

}  // namespace railfix::monitor
