#include "fusion/rhythm.hpp"

#include <cmath>
#include <utility>

#include "core/time.hpp"

namespace railfix::fusion {
namespace {

constexpr double kOffS = 0.003;
constexpr double kGapS = 0.05;
constexpr int kSamples = 10;  // tell a rhythm

}  // namespace

double Rhythm::add(double dt_s) {
  // While other sensors went on the clock did, too.
  const double late_s = std::min(dt_s - period_s_, std::exchange(pause_s_, 0.0));
  const double off_s = std::max(late_s, period_s_ - dt_s);
  if (samples_ < kSamples || off_s <= std::max(kOffS, 0.1 * period_s_)) {
    period_s_ += (dt_s - period_s_) / std::min(++samples_, 20);
    off_ = 0;
    off_time_s_ = 0;
    return 0;
  }
  off_time_s_ += dt_s;
  if (++off_ == kSamples) {  // another rhythm than the first ones had, of which some had been lost
    period_s_ = off_time_s_ / off_;
    samples_ = kSamples;
    off_ = 0;
    off_time_s_ = 0;
  }
  return off_s;
}

void DataGap::add(int64_t before_ns, int64_t stamp_ns, double speed_mps) {
  const double gap_s = core::seconds(stamp_ns - before_ns);
  if (samples_ >= kSamples && gap_s > std::max(kGapS, 5 * period_s_)) {
    if (way_m_ == 0) begin_ns_ = before_ns;
    way_m_ += std::abs(speed_mps) * gap_s;
  } else {
    period_s_ += (gap_s - period_s_) / std::min(++samples_, 50);
  }
}

}  // namespace railfix::fusion
