#include "sensor_gateway/frame_watch.hpp"

#include <spdlog/fmt/fmt.h>

#include "core/time.hpp"

namespace railfix::sensor_gateway {
namespace {

constexpr int64_t kWindowNs = 10 * core::kNsPerSecond;
constexpr uint64_t kTooMany = 3;  // one or two are what was cut where listening began

}  // namespace

void FrameWatch::add(const Frames& frames, int64_t now_ns) {
  parts_.push_back({now_ns, frames});
  sum_.whole += frames.whole;
  sum_.broken += frames.broken;
  forget_before(now_ns - kWindowNs);
}

void FrameWatch::forget_before(int64_t ns) {
  for (; !parts_.empty() && parts_.front().ns < ns; parts_.pop_front()) {
    sum_.whole -= parts_.front().frames.whole;
    sum_.broken -= parts_.front().frames.broken;
  }
}

std::string FrameWatch::trouble(int64_t now_ns) {
  forget_before(now_ns - kWindowNs);
  if (sum_.broken < kTooMany) return "";
  return fmt::format(
      "sends broken messages ({} of the last {} are lost); check its cable and shield, and that live.baud is the "
      "receiver's and enough for what it sends",
      sum_.broken, sum_.whole + sum_.broken);
}

}  // namespace railfix::sensor_gateway
