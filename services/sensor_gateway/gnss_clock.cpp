#include "sensor_gateway/gnss_clock.hpp"

#include <cstdlib>

#include "core/time.hpp"

namespace railfix::sensor_gateway {
namespace {

constexpr int kReportsToLearn = 4;
constexpr int64_t kEarlyNs = 50'000'000;             // a report that comes before its position: clocks disagree
constexpr int64_t kLatestNs = core::kNsPerSecond;    // slow receivers need most of a second
constexpr int64_t kGapNs = 30 * core::kNsPerSecond;  // what was learnt before may not be true any more
}  // namespace

std::optional<int64_t> GnssClock::stamp_ns(int64_t utc_ns, const core::HostTime& arrival, bool clock_is_kept) {
  if (last_utc_ns_ && std::abs(utc_ns - *last_utc_ns_) > kGapNs) {
    clock_ = core::DeviceClock();
    learnt_from_ = 0;
  }
  last_utc_ns_ = utc_ns;
  const int64_t host_ns = clock_.host_ns(utc_ns, arrival);
  const bool learnt = ++learnt_from_ >= kReportsToLearn;
  contradiction_s_.reset();
  if (!clock_is_kept) return learnt ? std::optional(host_ns - latency_ns_) : std::nullopt;
  const int64_t least_late_ns = host_ns - utc_ns;
  if (least_late_ns >= -kEarlyNs && least_late_ns <= kLatestNs) return utc_ns;
  if (learnt) contradiction_s_ = core::seconds(least_late_ns - latency_ns_);
  return std::nullopt;
}

}  // namespace railfix::sensor_gateway
