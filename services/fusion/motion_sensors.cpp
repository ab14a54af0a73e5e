#include "fusion/motion_sensors.hpp"

#include <algorithm>

#include "core/time.hpp"

namespace railfix::fusion {
namespace {

constexpr double kAtWorkS = 0.3;

}  // namespace

void MotionSensors::set_clock(int64_t stamp_ns) {
  for (auto& watch : watches_) watch.set_clock(stamp_ns);
  begin_ns_ = std::min(begin_ns_, stamp_ns);
  now_ns_ = stamp_ns;
}

bool MotionSensors::used_within(Source source, double time_s) const {
  return (*this)[source].used_within(time_s, now_ns_);
}

bool MotionSensors::measures(Source source) const {
  return used_within(source, kAtWorkS);
}

int MotionSensors::at_work() const {
  return static_cast<int>(std::ranges::count_if(kMotionSources, [&](Source source) { return measures(source); }));
}

bool MotionSensors::know_motion(double bridge_s) const {
  const bool bridged = used_within(Source::camera, bridge_s) || used_within(Source::wheel, bridge_s);
  return used_lately(Source::camera) || used_lately(Source::wheel) || (bridged && used_lately(Source::imu));
}

uint32_t MotionSensors::isolated() const {
  uint32_t bits = 0;
  for (const auto source : kMotionSources) {
    if ((*this)[source].isolated) bits |= 1U << static_cast<unsigned>(source);
  }
  return bits;
}

bool MotionSensors::dispute(std::span<const Source> sources, std::optional<Source> but_for) const {
  return std::ranges::any_of(
      sources, [&](Source source) { return source != but_for && (*this)[source].isolated_without_proof(); });
}

bool MotionSensors::silent(Source source, double timeout_s) const {
  const auto& watch = (*this)[source];
  return watch.seen_ns != 0 && core::seconds(now_ns_ - watch.seen_ns) > timeout_s;
}

double MotionSensors::unused_for_s(Source source) const {
  const int64_t used_ns = (*this)[source].used_ns;
  return core::seconds(now_ns_ - (used_ns == 0 ? begin_ns_ : used_ns));
}

}  // namespace railfix::fusion
