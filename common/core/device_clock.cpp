#include "core/device_clock.hpp"

#include <algorithm>
#include <cmath>

namespace railfix::core {
namespace {

constexpr int64_t kWindowNs = 2 * kNsPerSecond;
constexpr size_t kMostWindows = 16;
constexpr size_t kWindowsForDrift = 5;
constexpr double kWorstDrift = 3e-4;
constexpr int64_t kLateNs = kNsPerSecond;
constexpr int64_t kNotLateNs = 3 * kNsPerSecond;  // who comes so late for so long has another clock

}  // namespace

int64_t DeviceClock::host_ns(int64_t device_ns, const HostTime& arrival) {
  if (is_set_anew(device_ns, arrival.monotonic_ns)) {
    lowest_.clear();
    drift_ = 0;
    late_since_ns_.reset();
  }
  last_device_ns_ = device_ns;
  if (!late_since_ns_) add(device_ns, arrival.monotonic_ns - device_ns);
  last_host_ns_ = std::max(last_host_ns_ + 1, device_ns + offset_ns(device_ns));
  return last_host_ns_ + arrival.wall_ns - arrival.monotonic_ns;
}

// No message comes before its least time; late ones come one behind the other until the link has caught up.
bool DeviceClock::is_set_anew(int64_t device_ns, int64_t arrival_ns) {
  if (!last_device_ns_) return false;
  const int64_t late_ns = arrival_ns - device_ns - offset_ns(device_ns);
  if (late_ns <= kLateNs) late_since_ns_.reset();
  if (late_ns > kLateNs && !late_since_ns_) late_since_ns_ = arrival_ns;
  return device_ns <= *last_device_ns_ || late_ns < -kLateNs ||
         (late_since_ns_ && arrival_ns - *late_since_ns_ > kNotLateNs);
}

void DeviceClock::add(int64_t device_ns, int64_t offset) {
  if (lowest_.empty() || device_ns - window_begin_ns_ >= kWindowNs) {
    fit_drift();
    window_begin_ns_ = device_ns;
    lowest_.push_back({device_ns, offset});
    if (lowest_.size() > kMostWindows) lowest_.pop_front();
  } else if (offset < lowest_.back().offset_ns) {
    lowest_.back() = {device_ns, offset};
  }
}

void DeviceClock::fit_drift() {
  if (lowest_.size() < kWindowsForDrift) return;
  double mean_s = 0;
  double mean_offset_s = 0;
  const auto count = static_cast<double>(lowest_.size());
  const auto& first = lowest_.front();
  for (const auto& one : lowest_) {
    mean_s += seconds(one.device_ns - first.device_ns) / count;
    mean_offset_s += seconds(one.offset_ns - first.offset_ns) / count;
  }
  double square = 0;
  double product = 0;
  for (const auto& one : lowest_) {
    const double s = seconds(one.device_ns - first.device_ns) - mean_s;
    square += s * s;
    product += s * (seconds(one.offset_ns - first.offset_ns) - mean_offset_s);
  }
  drift_ = std::clamp(product / square, -kWorstDrift, kWorstDrift);
}

int64_t DeviceClock::offset_ns(int64_t device_ns) const {
  int64_t lowest = INT64_MAX;
  for (const auto& one : lowest_) {
    const double moved_ns = drift_ * static_cast<double>(device_ns - one.device_ns);
    lowest = std::min(lowest, one.offset_ns + static_cast<int64_t>(moved_ns));
  }
  return lowest;
}

}  // namespace railfix::core
