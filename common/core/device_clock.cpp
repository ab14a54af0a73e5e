#include "core/device_clock.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "core/time.hpp"

namespace railfix::core {
namespace {

constexpr int64_t kWindowNs = 2 * kNsPerSecond;
constexpr size_t kMostWindows = 16;
constexpr size_t kWindowsForDrift = 5;
constexpr double kWorstDrift = 3e-4;
constexpr int64_t kSetAnewNs = kNsPerSecond;

}  // namespace

int64_t DeviceClock::host_ns(int64_t device_ns, int64_t arrival_ns) {
  const int64_t offset = arrival_ns - device_ns;
  const bool set_back = last_device_ns_ && device_ns <= *last_device_ns_;
  const bool jumped = !lowest_.empty() && std::abs(offset - offset_ns(device_ns)) > kSetAnewNs;
  if (set_back || jumped) {
    lowest_.clear();
    drift_ = 0;
    if (jumped) last_host_ns_ = INT64_MIN;
  }
  last_device_ns_ = device_ns;
  add(device_ns, offset);
  last_host_ns_ = std::max(last_host_ns_ + 1, device_ns + offset_ns(device_ns));
  return last_host_ns_;
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
