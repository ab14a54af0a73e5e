#include "fusion/slip_watch.hpp"

#include <algorithm>

#include "core/time.hpp"

namespace railfix::fusion {
namespace {

constexpr double kMarkS = 0.1;
constexpr double kWindowS = 1.0;
constexpr double kShortestS = 0.3;
constexpr double kWheelFreshS = 0.15;
constexpr size_t kPictures = 4;

}  // namespace

void SlipWatch::wheel(int64_t stamp_ns, double wheel_m) {
  wheel_before_ = wheel_last_;
  wheel_last_ = {stamp_ns, wheel_m};
}

void SlipWatch::no_picture() {
  pictures_.clear();
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
  const auto reference = std::find_if(pictures_.begin(), pictures_.end(), [&](const Reading& picture) {
    return picture.stamp_ns == step.reference_stamp_ns;
  });
  const auto wheel_m = wheel_at(step.stamp_ns);
  if (reference == pictures_.end() || !wheel_m) {
    no_picture();
    pictures_.push_back({step.stamp_ns, 0});
    return std::nullopt;
  }
  const Reading base = *reference;
  const double visual_m = base.metres + step.step_m;
  ++steps_;
  // The reference may be kept for long; of the others the oldest goes.
  if (pictures_.size() >= kPictures) {
    const bool reference_first = pictures_.front().stamp_ns == base.stamp_ns;
    pictures_.erase(pictures_.begin() + (reference_first ? 1 : 0));
  }
  pictures_.push_back({step.stamp_ns, visual_m});

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
