#include "fusion/camera_lag.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/time.hpp"

namespace railfix::fusion {
namespace {

constexpr double kWindowS = 1.0;
constexpr double kSpeedS = 0.15;  // a speed is that of so long before and behind
constexpr double kPauseS = 0.5;   // no sample for so long
constexpr double kKeptS = 5.0;
constexpr double kRatioSigma = 0.03;
constexpr double kCreepSigma = 0.005;  // a driven axle runs half a per cent ahead at 1 m/s2
constexpr double kLagSigma = 0.3;      // of the farthest
constexpr double kStandsM = 0.02;      // in a window
constexpr double kRatioWalk = 1e-4;    // from window to window
constexpr double kCreepWalk = 2e-5;
constexpr double kLagWalkS = 3e-4;
constexpr double kGrowthSigma = 1e-4;  // two cheap oscillators: 50 ppm each
constexpr double kGrowthWalk = 1e-7;
constexpr double kPlayM = 0.005;    // of the wheel's reading, beside its pulses
constexpr double kWaySigma = 3e-4;  // share of a window's way
constexpr double kSameGainMps = 0.15;
constexpr double kSameGain = 0.15;  // ... and this share of it
constexpr double kFarthestS = 2.0;
constexpr double kGate = 4.0;
constexpr int kRefusedInRow = 8;        // then the ratio is another one, or the lag
constexpr double kUnevenS = 0.01;       // less is the jitter of stamps ...
constexpr double kUnevenBlindS = 0.03;  // ... where no way says that they have jumped
constexpr double kStoodSigmaS = 0.02;   // a jump while the train stands shows nowhere
constexpr double kJumpShare = 0.2;      // that the size of a jump may be wrong by
constexpr double kSpeedBackS = 0.3;     // the speed before a jump is that of so long
constexpr double kSlowMps = 1.0;        // the way of a slower train says no jump

Eigen::Vector4d squares(double ratio, double creep, double lag_s, double growth) {
  return {ratio * ratio, creep * creep, lag_s * lag_s, growth * growth};
}

/// Pictures that were left out leave a gap of whole ones.
bool is_whole(double one_s, double other_s) {
  const auto [shorter_s, longer_s] = std::minmax(one_s, other_s);
  if (!(shorter_s > 0)) return false;
  return std::abs(std::remainder(longer_s, shorter_s)) < 0.15 * shorter_s;
}

}  // namespace

CameraLag::CameraLag(double farthest_s) : farthest_s_(farthest_s) {
  covariance_ = squares(kRatioSigma, kCreepSigma, lag_sigma_s(), kGrowthSigma).asDiagonal();
}

CameraLag::Lag CameraLag::unknown() {
  return {0, kLagSigma * kUsualS};
}

double CameraLag::lag_sigma_s() const {
  return kLagSigma * farthest_s_;
}

void CameraLag::look_elsewhere() {
  *this = CameraLag(farthest_s_ < kFarthestS ? kFarthestS : kUsualS);
}

std::optional<CameraLag::Lag> CameraLag::lag() const {
  if (!compared_) return std::nullopt;
  return Lag{fitted_(2), std::sqrt(covariance_(2, 2))};
}

bool CameraLag::is_narrowed() const {
  return covariance_(2, 2) < lag_sigma_s() * lag_sigma_s();
}

void CameraLag::doubt(double sigma_s) {
  if (is_narrowed()) covariance_(2, 2) += sigma_s * sigma_s;
}

void CameraLag::begin_again(const OdometryInput& step) {
  way_.clear();
  seen_.clear();
  mark_.reset();
  if (!step.valid) return;
  way_.begin(step.stamp_ns);
  seen_.push_back({step.stamp_ns, 0, 0});
}

void CameraLag::add(const WheelInput& sample) {
  if (!(sample.pulses_per_metre > 0)) return;
  const double since_s = wheel_.empty() ? kSpeedS : core::seconds(sample.stamp_ns - wheel_.back().stamp_ns);
  if (std::abs(since_s) > kPauseS) {
    wheel_.clear();
    mark_.reset();
  } else if (since_s <= 0) {
    return;
  }
  const double variance_m2 = kPlayM * kPlayM + 1 / (12 * sample.pulses_per_metre * sample.pulses_per_metre);
  wheel_.push_back({sample.stamp_ns, static_cast<double>(sample.pulses) / sample.pulses_per_metre, variance_m2});
  while (core::seconds(sample.stamp_ns - wheel_.front().stamp_ns) > kKeptS) wheel_.pop_front();
  compare();
}

void CameraLag::add(const OdometryInput& step) {
  const auto picture = step.valid ? way_.add(step) : std::nullopt;
  const auto jumped = jump(step.stamp_ns, picture);
  const double passed_s = last_step_ns_ ? core::seconds(step.stamp_ns - *last_step_ns_) : 0;
  if (last_step_ns_ && passed_s <= 0 && !jumped) return;  // late
  last_step_ns_ = step.stamp_ns;
  if (jumped) {
    has_jumped_ = std::abs(passed_s) < kPauseS;
    fitted_(2) += jumped->late_s;
    doubt(jumped->sigma_s);
  } else if (passed_s < interval_s_ || !is_whole(passed_s, interval_s_)) {
    interval_s_ = passed_s;
  }
  if (!picture || jumped) return begin_again(step);
  seen_.push_back(*picture);
  while (core::seconds(step.stamp_ns - seen_.front().stamp_ns) > kKeptS) seen_.pop_front();
}

/// What the stamps have gone on beyond the way, where they are uneven: at even ones it is the way that is wrong.
/// Without a way, or where it says something else again, what they may have jumped by.
std::optional<CameraLag::Lag> CameraLag::jump(int64_t stamp_ns, const std::optional<Reading>& picture) const {
  if (!last_step_ns_ || !(interval_s_ > 0)) return std::nullopt;
  const double passed_s = core::seconds(stamp_ns - *last_step_ns_);
  if (std::abs(passed_s) > kPauseS) return unknown();
  const double uneven_s = passed_s - interval_s_;
  if (std::abs(uneven_s) < kUnevenS) return std::nullopt;
  const auto speed_mps = picture ? seen_speed_mps() : std::nullopt;
  if (!speed_mps || std::abs(*speed_mps) < kSlowMps) {
    if (std::abs(uneven_s) < kUnevenBlindS || is_whole(passed_s, interval_s_)) return std::nullopt;
    return Lag{0, std::abs(uneven_s)};
  }
  const double jump_s = passed_s - (picture->way_m - seen_.back().way_m) / *speed_mps;
  if (std::abs(jump_s) < kUnevenS) return std::nullopt;
  const double sigma_s = std::max(kUnevenS, kJumpShare * std::abs(jump_s));
  const double left_out = std::max(0.0, std::round((uneven_s - jump_s) / interval_s_));
  if (std::abs(uneven_s - jump_s - left_out * interval_s_) > sigma_s) return Lag{0, std::abs(uneven_s)};
  return Lag{jump_s, sigma_s};
}

std::optional<double> CameraLag::seen_speed_mps() const {
  if (seen_.empty()) return std::nullopt;
  const auto before = reading_at(seen_, seen_.back().stamp_ns - core::to_ns(kSpeedBackS));
  if (!before) return std::nullopt;
  return (seen_.back().way_m - before->way_m) / kSpeedBackS;
}

std::optional<CameraLag::Reading> CameraLag::reading_at(const Readings& readings, int64_t stamp_ns) {
  const auto next = std::ranges::lower_bound(readings, stamp_ns, {}, &Reading::stamp_ns);
  if (next == readings.begin() || next == readings.end()) return std::nullopt;
  const Reading& before = *std::prev(next);
  const double gap_s = core::seconds(next->stamp_ns - before.stamp_ns);
  if (gap_s > kPauseS) return std::nullopt;
  const double share = core::seconds(stamp_ns - before.stamp_ns) / gap_s;
  return Reading{stamp_ns, std::lerp(before.way_m, next->way_m, share), next->variance_m2};
}

std::optional<CameraLag::Moving> CameraLag::moving_at(const Readings& readings, int64_t stamp_ns) {
  const auto at = reading_at(readings, stamp_ns);
  const auto before = reading_at(readings, stamp_ns - core::to_ns(kSpeedS));
  const auto after = reading_at(readings, stamp_ns + core::to_ns(kSpeedS));
  if (!at || !before || !after) return std::nullopt;
  return Moving{*at, (after->way_m - before->way_m) / (2 * kSpeedS)};
}

void CameraLag::compare() {
  if (seen_.empty()) return;
  const int64_t known_ns = std::min(wheel_.back().stamp_ns, seen_.back().stamp_ns) - core::to_ns(kSpeedS);
  const int64_t due_ns = mark_ ? mark_->wheel.at.stamp_ns + core::to_ns(kWindowS) : known_ns;
  if (known_ns < due_ns) return;
  const auto camera = moving_at(seen_, known_ns);
  const auto wheel = moving_at(wheel_, known_ns);
  if (!camera || !wheel) return;
  const Mark mark{*camera, *wheel};
  if (mark_) fit(*mark_, mark);
  mark_ = mark;
  compared_ = true;
}

// What a standing train knows of the ratio and the creep it still knows when it goes on; the clocks run on.
void CameraLag::pass(double seconds) {
  if (is_narrowed()) {
    Eigen::Matrix4d on = Eigen::Matrix4d::Identity();
    on(2, 3) = seconds;
    fitted_ = on * fitted_;
    covariance_ = on * covariance_ * on.transpose();
  }
  covariance_.diagonal() += squares(kRatioWalk, kCreepWalk, kLagWalkS, kGrowthWalk);
}

void CameraLag::fit(const Mark& from, const Mark& to) {
  pass(core::seconds(to.wheel.at.stamp_ns - from.wheel.at.stamp_ns));
  const double wheel_m = to.wheel.at.way_m - from.wheel.at.way_m;
  if (std::abs(wheel_m) < kStandsM) {
    stood_ = true;
    return;
  }
  if (std::exchange(stood_, false)) doubt(kStoodSigmaS);
  const double gained_mps = to.wheel.speed_mps - from.wheel.speed_mps;
  const double seen_mps = to.camera.speed_mps - from.camera.speed_mps;
  if (std::abs(seen_mps - gained_mps) > kSameGainMps + kSameGain * std::abs(gained_mps)) return;
  const Eigen::Vector4d by(wheel_m, -gained_mps * wheel_m, -gained_mps, 0);
  const double off_m = to.camera.at.way_m - from.camera.at.way_m - wheel_m - by.dot(fitted_);
  const double noise_m2 = to.camera.at.variance_m2 - from.camera.at.variance_m2 + from.wheel.at.variance_m2 +
                          to.wheel.at.variance_m2 + kWaySigma * kWaySigma * wheel_m * wheel_m;
  const double variance = by.dot(covariance_ * by) + noise_m2;
  if (off_m * off_m > kGate * kGate * variance) {
    if (++refused_ == kRefusedInRow) look_elsewhere();
    return;
  }
  refused_ = 0;
  const Eigen::Vector4d gain = covariance_ * by / variance;
  fitted_ += gain * off_m;
  covariance_ -= gain * gain.transpose() * variance;
  if (std::abs(fitted_(2)) > farthest_s_) look_elsewhere();
}

}  // namespace railfix::fusion
