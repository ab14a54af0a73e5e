#include "frame_grabber/camera_clock.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "core/time.hpp"

namespace railfix::frame_grabber {
namespace {

constexpr int64_t kWindowNs = 2 * core::kNsPerSecond;
constexpr size_t kMostWindows = 16;
constexpr size_t kWindowsForDrift = 5;
constexpr double kWorstDrift = 3e-4;
constexpr int64_t kSetAnewNs = core::kNsPerSecond;

}  // namespace

int64_t CameraClock::host_ns(int64_t camera_ns, int64_t arrival_ns) {
  const int64_t offset = arrival_ns - camera_ns;
  const bool set_back = last_camera_ns_ && camera_ns <= *last_camera_ns_;
  const bool jumped = !lowest_.empty() && std::abs(offset - offset_ns(camera_ns)) > kSetAnewNs;
  if (set_back || jumped) {
    lowest_.clear();
    drift_ = 0;
    if (jumped) last_host_ns_ = INT64_MIN;
  }
  last_camera_ns_ = camera_ns;
  add(camera_ns, offset);
  last_host_ns_ = std::max(last_host_ns_ + 1, camera_ns + offset_ns(camera_ns));
  return last_host_ns_;
}

void CameraClock::add(int64_t camera_ns, int64_t offset) {
  if (lowest_.empty() || camera_ns - window_begin_ns_ >= kWindowNs) {
    fit_drift();
    window_begin_ns_ = camera_ns;
    lowest_.push_back({camera_ns, offset});
    if (lowest_.size() > kMostWindows) lowest_.pop_front();
  } else if (offset < lowest_.back().offset_ns) {
    lowest_.back() = {camera_ns, offset};
  }
}

void CameraClock::fit_drift() {
  if (lowest_.size() < kWindowsForDrift) return;
  double mean_s = 0;
  double mean_offset_s = 0;
  const auto count = static_cast<double>(lowest_.size());
  const auto& first = lowest_.front();
  for (const auto& one : lowest_) {
    mean_s += core::seconds(one.camera_ns - first.camera_ns) / count;
    mean_offset_s += core::seconds(one.offset_ns - first.offset_ns) / count;
  }
  double square = 0;
  double product = 0;
  for (const auto& one : lowest_) {
    const double s = core::seconds(one.camera_ns - first.camera_ns) - mean_s;
    square += s * s;
    product += s * (core::seconds(one.offset_ns - first.offset_ns) - mean_offset_s);
  }
  drift_ = std::clamp(product / square, -kWorstDrift, kWorstDrift);
}

int64_t CameraClock::offset_ns(int64_t camera_ns) const {
  int64_t lowest = INT64_MAX;
  for (const auto& one : lowest_) {
    const double moved_ns = drift_ * static_cast<double>(camera_ns - one.camera_ns);
    lowest = std::min(lowest, one.offset_ns + static_cast<int64_t>(moved_ns));
  }
  return lowest;
}

}  // namespace railfix::frame_grabber
