#include "fusion/sudden_change.hpp"

#include <algorithm>

#include "core/time.hpp"

namespace railfix::fusion {
namespace {

constexpr double kWorksS = 1.0;      // a sensor that has not agreed for so long is no witness: it may be faulty
constexpr double kCallS = 0.3;       // calls so near each other mean the same change
constexpr double kUnnoticedS = 0.1;  // so long a change may go on inside the gates

bool lately(int64_t then_ns, int64_t now_ns, double time_s) {
  return then_ns != 0 && core::seconds(now_ns - then_ns) <= time_s;
}

}  // namespace

bool SuddenChange::called(Source source, int64_t stamp_ns, bool forward) {
  auto& mine = sensor(source);
  if (!lately(mine.agreed_ns, stamp_ns, kWorksS)) return false;
  mine.called_ns = stamp_ns;
  mine.forward = forward;
  bool alone = true;
  for (const auto& other : sensors_) {
    if (&other == &mine) continue;
    const bool works = lately(other.agreed_ns, stamp_ns, kWorksS);
    if (works && lately(other.called_ns, stamp_ns, kCallS) && other.forward == forward) return true;
    alone = alone && !lately(other.agreed_ns, stamp_ns, kCallS);
  }
  // An accelerometer alone may throw outliers: an odometer's way is what a change leaves behind.
  return alone && source != Source::imu;
}

double SuddenChange::since_s(int64_t stamp_ns) const {
  int64_t agreed_ns = 0;
  for (const auto& sensor : sensors_) agreed_ns = std::max(agreed_ns, sensor.agreed_ns);
  return std::clamp(core::seconds(stamp_ns - agreed_ns), 0.0, kWorksS) + kUnnoticedS;
}

}  // namespace railfix::fusion
