#include "fusion/gyro_watch.hpp"

#include <algorithm>
#include <cmath>

#include "core/time.hpp"

namespace railfix::fusion {
namespace {

constexpr int kRepeats = 10;
constexpr double kRepeatsS = 1.0;     // a train that runs never turns alike for so long, in steps however coarse
constexpr double kRunsM = 1.0;        // less in a period may be a train that has just stopped
constexpr double kSeenShare = 0.8;    // of a period by the camera
constexpr double kTurnShare = 0.1;    // of a turn: the ends of the period are not those of the pictures
constexpr double kCameraPerM = 1e-4;  // the camera turns too far or too little by so much a metre, lastingly
constexpr double kBiasWalk = 5e-5;    // rad/s per square root of a second
constexpr double kForgetS = 60.0;     // while it is contradicted: a new bias that lasts is one as well
constexpr double kSigmas = 4.0;
constexpr size_t kLeastPieces = 3;
constexpr int kWell = 12;

}  // namespace

void GyroWatch::add(int64_t stamp_ns, double rate_rps) {
  if (const double step_rps = rate_rps - rate_.value(); std::isfinite(step_rps)) {
    squares_ += step_rps * step_rps;
    ++samples_;
  }
  has_turned_ = has_turned_ || rate_rps != 0;
  rate_.add(rate_rps, stamp_ns);
}

void GyroWatch::add(const OdometryInput& step) {
  const bool told = step.valid && step.yaw_sigma_rad > 0 && std::isfinite(step.yaw_rad + step.yaw_sigma_rad);
  if (told && step_) {
    const bool same = step.reference_stamp_ns == step_->reference_stamp_ns;
    if (same || step.reference_stamp_ns == step_->stamp_ns) {
      camera_rad_ += step.yaw_rad - (same ? step_->yaw_rad : 0);
      camera_variance_ += step.yaw_sigma_rad * step.yaw_sigma_rad;
      camera_s_ += core::seconds(step.stamp_ns - step_->stamp_ns);
    }
  }
  step_ = told ? std::optional(step) : std::nullopt;
}

void GyroWatch::judge(const Turned& turned, int64_t stamp_ns) {
  const auto now = fault_now(turned);
  begin_period();
  if (!now) return;
  well_ = now == Fault::none ? well_ + 1 : 0;
  if (now != Fault::none && fault_ == Fault::none) since_ns_ = stamp_ns;
  if (now != Fault::none || well_ >= kWell) fault_ = *now;
}

// Nothing where a fault that was found could not be seen.
std::optional<GyroWatch::Fault> GyroWatch::fault_now(const Turned& turned) {
  if (!has_turned_) return Fault::absent;
  if (rate_.lasts(kRepeats, kRepeatsS))
    return std::abs(turned.way_m) > kRunsM ? std::optional(Fault::stuck) : std::nullopt;
  // Of the mean of the samples, from how they differ from each other.
  const double scatter_rad = samples_ > 0 ? std::sqrt(0.5 * squares_) / samples_ * turned.time_s : 0;
  if (scatter_rad > turned.sigma_rad) return Fault::scatters;
  if (camera_s_ < kSeenShare * turned.time_s) {
    count_ = 0;
    return fault_ == Fault::contradicted ? std::nullopt : std::optional(Fault::none);
  }
  const double camera_rad = camera_rad_ * turned.time_s / camera_s_;
  std::shift_right(pieces_.begin(), pieces_.end(), 1);
  count_ = std::min(count_ + 1, kMost);
  const double ends_rad = kTurnShare * camera_rad;
  pieces_[0] = {turned.gyro_rad - camera_rad, std::nullopt,
                turned.sigma_rad * turned.sigma_rad + camera_variance_ + ends_rad * ends_rad, turned.way_m,
                turned.time_s};
  if (turned.track_rad) pieces_[0].gyro_from_track_rad = turned.gyro_rad - *turned.track_rad;
  if (contradicted()) {
    bias_variance_ = std::min(bias_variance_ + kGyroBiasSigmaRps * kGyroBiasSigmaRps * turned.time_s / kForgetS,
                              kGyroBiasSigmaRps * kGyroBiasSigmaRps);
    return Fault::contradicted;
  }
  learn_bias(pieces_[0].gyro_from_camera_rad, pieces_[0].variance, turned.time_s);
  return Fault::none;
}

// Who is stuck at rest says nothing of its bias, and what was judged before has another one.
void GyroWatch::rest(const Turned& turned) {
  begin_period();
  count_ = 0;
  if (rate_.count() < kRepeats) learn_bias(turned.gyro_rad, turned.sigma_rad * turned.sigma_rad, turned.time_s);
}

void GyroWatch::learn_bias(double turned_rad, double variance, double time_s) {
  bias_variance_ += kBiasWalk * kBiasWalk * time_s;
  const double gain = bias_variance_ / (bias_variance_ + variance / (time_s * time_s));
  bias_rps_ += gain * (turned_rad / time_s - bias_rps_);
  bias_variance_ *= 1 - gain;
}

// Over the last pieces together, however many: a small error needs many, a large one is not to be waited for.
bool GyroWatch::contradicted() const {
  double from_camera_rad = 0;
  double from_track_rad = 0;
  double variance = 0;
  double way_m = 0;
  double time_s = 0;
  bool track_known = true;
  for (size_t i = 0; i < count_; ++i) {
    const Piece& piece = pieces_[i];
    const double bias_rad = bias_rps_ * piece.time_s;
    from_camera_rad += piece.gyro_from_camera_rad - bias_rad;
    track_known = track_known && piece.gyro_from_track_rad;
    from_track_rad += piece.gyro_from_track_rad.value_or(0) - bias_rad;
    variance += piece.variance;
    way_m += std::abs(piece.way_m);
    time_s += piece.time_s;
    const double sigma_rad = std::hypot(std::sqrt(variance), kCameraPerM * way_m, std::sqrt(bias_variance_) * time_s);
    const bool apart = i + 1 >= kLeastPieces && std::abs(from_camera_rad) > kSigmas * sigma_rad;
    // Nearer to the track than to the camera: it is the camera that is wrong.
    if (apart && (!track_known || 2 * std::abs(from_track_rad) > std::abs(from_camera_rad))) return true;
  }
  return false;
}

void GyroWatch::set_clock(int64_t stamp_ns) {
  begin_period();
  count_ = 0;
  rate_ = {};
  step_.reset();
  since_ns_ = std::min(since_ns_, stamp_ns);
}

void GyroWatch::begin_period() {
  squares_ = 0;
  samples_ = 0;
  camera_rad_ = camera_variance_ = camera_s_ = 0;
}

}  // namespace railfix::fusion
