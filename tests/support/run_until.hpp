// Waits for what the services under test send, and handles it meanwhile.
#pragma once

#include "core/time.hpp"
#include "messaging/messaging.hpp"

namespace railfix::test {

inline constexpr double kPatienceS = 60;

/// Handles the queue until the condition holds; false when that takes too long.
template <class Condition>
bool run_until(messaging::Queue& queue, Condition condition, double patience_s = kPatienceS) {
  constexpr int64_t kPeriodNs = 20'000'000;
  const int64_t deadline_ns = core::monotonic_ns() + core::to_ns(patience_s);
  while (!condition()) {
    if (core::monotonic_ns() > deadline_ns) return false;
    queue.run_one(core::monotonic_ns() + kPeriodNs);
  }
  return true;
}

}  // namespace railfix::test
