#include "track_detector/imu_roll.hpp"

#include <algorithm>
#include <cmath>

#include "core/time.hpp"
#include "core/units.hpp"

namespace railfix::track_detector {
namespace {

constexpr double kDamping = 0.4;      // share of the critical one
constexpr double kTwistLastsS = 4.0;  // a cant ramp
constexpr double kStepS = 0.010;
constexpr double kFastestRollRps = 2.0;  // no body on rails rolls faster: the sample is a wrong one
constexpr double kForgetS = 1.0;         // without samples nothing is known of the swinging any more
constexpr size_t kMostWaiting = 4000;
constexpr double kLeastSway = 0.3;  // of the limit, however large the standing part

}  // namespace

ImuRoll::ImuRoll(const ImuRollOptions& options, const geometry::CameraPose& mount, double limit_rad)
    : options_(options),
      mount_roll_rad_(mount.roll_rad),
      limit_rad_(limit_rad),
      sway_rad_(std::sqrt(std::max(limit_rad * limit_rad - options.slow_rad * options.slow_rad,
                                   kLeastSway * kLeastSway * limit_rad * limit_rad))),
      roll_per_rate_(1.0 / std::max(0.2, std::cos(mount.pitch_rad))) {
  know_nothing();
}

void ImuRoll::know_nothing() {
  const double sway_rate = core::kPi * 2 * options_.sway_hz * sway_rad_;
  state_ = estimation::StateVector::Zero(3);
  estimation::StateVector variances(3);
  variances << sway_rad_ * sway_rad_, sway_rate * sway_rate, options_.twist_rps * options_.twist_rps;
  filter_ = estimation::UdFilter(variances);
}

void ImuRoll::add(int64_t stamp_ns, double rate_x_rps) {
  if (!(std::abs(rate_x_rps) < kFastestRollRps)) return;
  const int64_t last_ns = waiting_.empty() ? state_ns_ : waiting_.back().stamp_ns;
  if (core::seconds(last_ns - stamp_ns) > kForgetS) {  // the data begin anew
    waiting_.clear();
    state_ns_ = 0;
    asked_ns_ = 0;
  } else if (stamp_ns <= last_ns) {
    return;
  }
  waiting_.push_back({stamp_ns, rate_x_rps * roll_per_rate_});
  if (waiting_.size() > kMostWaiting) use_oldest();
}

void ImuRoll::use_oldest() {
  const Sample sample = waiting_.front();
  waiting_.pop_front();
  const double interval_s = core::seconds(sample.stamp_ns - state_ns_);
  if (state_ns_ == 0 || interval_s > kForgetS) {
    know_nothing();
  } else {
    pass(interval_s, filter_, state_);
  }
  state_ns_ = sample.stamp_ns;
  estimation::StateVector h(3);
  h << 0, 1, 1;
  state_ += filter_.update(h, sample.rate_rps - h.dot(state_), options_.noise_rps * options_.noise_rps);
}

// Second-order resonance, x'' = -2 z w x' - w^2 x + noise of density 4 z w^3 sigma^2: stationary with sigma.
void ImuRoll::pass(double interval_s, estimation::UdFilter& filter, estimation::StateVector& state) const {
  const double w = core::kPi * 2 * options_.sway_hz;
  Eigen::Matrix3d rates;
  rates << 0, 1, 0, -w * w, -2 * kDamping * w, 0, 0, 0, -1 / kTwistLastsS;
  const int steps = std::max(1, static_cast<int>(std::ceil(interval_s / kStepS)));
  const double step_s = interval_s / steps;
  const estimation::StateMatrix phi =
      Eigen::Matrix3d::Identity() + rates * step_s + rates * rates * (0.5 * step_s * step_s);
  estimation::StateMatrix g = estimation::StateMatrix::Zero(3, 2);
  g(1, 0) = g(2, 1) = 1;
  estimation::StateVector q(2);
  q << 4 * kDamping * w * w * w * sway_rad_ * sway_rad_ * step_s,
      2 * options_.twist_rps * options_.twist_rps / kTwistLastsS * step_s;
  for (int i = 0; i < steps; ++i) {
    filter.propagate(phi, g, q);
    state = phi * state;
  }
}

std::optional<RollHint> ImuRoll::at(int64_t stamp_ns) {
  while (!waiting_.empty() && waiting_.front().stamp_ns <= asked_ns_) use_oldest();
  asked_ns_ = stamp_ns;
  const double ahead_s = core::seconds(stamp_ns - state_ns_);
  if (state_ns_ == 0 || ahead_s < 0 || ahead_s > kForgetS) return std::nullopt;
  estimation::UdFilter filter = filter_;
  estimation::StateVector state = state_;
  if (ahead_s > 0) pass(ahead_s, filter, state);
  RollHint hint;
  hint.roll_rad = mount_roll_rad_ + state(0);
  hint.sigma_rad = std::min(limit_rad_, std::sqrt(filter.variance(0) + options_.slow_rad * options_.slow_rad));
  return hint;
}

}  // namespace railfix::track_detector
