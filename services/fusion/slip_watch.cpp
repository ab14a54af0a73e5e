#include "fusion/slip_watch.hpp"

#include <algorithm>

#include "core/time.hpp"

namespace railfix::fusion {
namespace {

constexpr double kMarkS = 0.1;
constexpr double kWindowS = 1.0;
constexpr double kShortestS = 0.3;
constexpr double kWheelFreshS = 0.15;

}  // namespace

void SlipWatch::wheel(int64_t stamp_ns, double wheel_m) {
  wheel_before_ = wheel_last_;
  wheel_last_ = {stamp_ns, wheel_m};
}

void SlipWatch::no_picture() {
  seen_.clear();
  marks_.clear();
  steps_ = 0;
}

// Extrapolated over less than one period with the wheel's own speed.
std::optional<double> SlipWatch::wheel_at(int64_t stamp_ns) const {
  if (wheel_before_.stamp_ns == 0 || core::seconds(stamp_ns - wheel_before_.stamp_ns) > kWheelFreshS)
    return std::nullopt;
  const double rate_mps =
      (wheel_last_.metres - wheel_before_.metres) / core::seconds(wheel_last_.stamp_ns - wheel_before_.stamp_ns);
  return wheel_last_.metres + rate_mps * core::seconds(stamp_ns - wheel_last_.stamp_ns);
}

std::optional<SlipWatch::Ways> SlipWatch::picture(const OdometryInput& step) {
  const auto picture = seen_.add(step);
  const auto wheel_m = wheel_at(step.stamp_ns);
  if (!picture || !wheel_m) {
    no_picture();
    seen_.begin(step.stamp_ns);
    return std::nullopt;
  }
  const double visual_m = picture->way_m;
  ++steps_;

  std::erase_if(marks_, [&](const Mark& m) { return core::seconds(step.stamp_ns - m.stamp_ns) > kWindowS; });
  if (marks_.empty() || core::seconds(step.stamp_ns - marks_.back().stamp_ns) >= kMarkS) {
    marks_.push_back({step.stamp_ns, visual_m, *wheel_m, steps_});
  }
  const Mark& oldest = marks_.front();
  const double time_s = core::seconds(step.stamp_ns - oldest.stamp_ns);
  if (time_s < kShortestS) return std::nullopt;
  return Ways{visual_m - oldest.visual_m, *wheel_m - oldest.wheel_m, steps_ - oldest.steps, time_s};
}

}  // namespace railfix::fusion
