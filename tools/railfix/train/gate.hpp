// Waits until services are healthy, as `up`, `upgrade` and `rollback` ask it of them.
#pragma once

#include <poll.h>

#include <functional>
#include <string>
#include <vector>

#include "core/time.hpp"
#include "service/health_file.hpp"
#include "train/plan.hpp"

namespace railfix::tool {

struct HealthGate {
  double healthy_s = 3;     // without a break, and without being started again
  double patience_s = 120;  // for that
  std::function<bool()> is_interrupted = [] { return false; };
};
using Say = std::function<void(const std::string&)>;

struct Waited {
  core::Status healthy;
  bool broken_off = false;  // interrupted, or somebody has typed `down`: nothing more is to be done
};

/// Until all of these are healthy. Does not wait for one that ends with exit code 2, which it would do again. Says what
/// is waited for. `must_send`: they did before.
Waited wait_healthy(const HostFolder& folder, const HostPlan& plan, const std::vector<std::string>& services,
                    const HealthGate& gate, const Say& say, bool must_send = false);

/// Its text: "active", "degraded: ...", "does not run: ended by Killed".
service::HealthAnswer health_of(const HostPlan& plan, const HostState& state, const std::string& service);

inline constexpr const char* kChangedMeanwhile =
    "another command has changed what runs here meanwhile (railfix train down, upgrade or rollback); this one has "
    "stopped, railfix train status says what runs";

template <class Condition>
bool wait_until(double patience_s, Condition condition) {
  constexpr int kTurnMs = 50;
  const int64_t deadline_ns = core::monotonic_ns() + core::to_ns(patience_s);
  while (!condition()) {
    if (core::monotonic_ns() > deadline_ns) return false;
    poll(nullptr, 0, kTurnMs);
  }
  return true;
}

}  // namespace railfix::tool
