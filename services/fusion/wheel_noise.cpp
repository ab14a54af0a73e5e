#include "fusion/wheel_noise.hpp"

#include <algorithm>
#include <cmath>

#include "core/median.hpp"
#include "core/time.hpp"

namespace railfix::fusion {
namespace {

constexpr double kPauseS = 0.5;          // readings further apart are not compared
constexpr double kOrdinaryMps2 = 2.0;    // what driving does to the speed is no noise
constexpr double kSigmasOfJump = 2.449;  // a jump has three readings in it: 1 + 4 + 1

}  // namespace

void WheelNoise::add(int64_t stamp_ns, double wheel_m) {
  const double step_s = core::seconds(stamp_ns - last_ns_);
  const double step_m = wheel_m - last_m_;
  const bool follows = last_ns_ != 0 && step_s > 0 && step_s < kPauseS;
  if (follows && step_s_ > 0) {
    const double shorter_s = std::min(step_s, step_s_);
    const double jump_m = std::abs(step_m / step_s - step_m_ / step_s_) * shorter_s;
    const double driven_m = kOrdinaryMps2 * 0.5 * (step_s + step_s_) * shorter_s;
    jumps_m_[count_++ % kJumps] = static_cast<float>(std::max(0.0, jump_m - driven_m));
  }
  last_ns_ = stamp_ns;
  last_m_ = wheel_m;
  step_s_ = follows ? step_s : 0;
  step_m_ = step_m;
}

double WheelNoise::sigma_m() const {
  if (count_ < kJumps) return 0;
  auto jumps_m = jumps_m_;
  std::nth_element(jumps_m.begin(), jumps_m.begin() + kJumps / 2, jumps_m.end());
  return core::kSigmaOfMedian / kSigmasOfJump * jumps_m[kJumps / 2];
}

}  // namespace railfix::fusion
