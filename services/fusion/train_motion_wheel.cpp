// The wheel: whether it slips, how it comes back, and what it may hide while nobody watches it.
#include <algorithm>
#include <cmath>
#include <utility>

#include "core/time.hpp"
#include "fusion/train_motion.hpp"

namespace railfix::fusion {
namespace {

constexpr double kRecoveryWayM = 1.0;  // a wheel shows by turning that it is well again
constexpr double kBrieflyS = 5.0;
constexpr double kSlipWindowS = 0.5;
constexpr int kGoodWindows = 2;
constexpr double kSlipTestSigmas = 3.0;
constexpr double kSilentS = 1.0;
constexpr double kSilentSlip = 0.1;  // share of the way
constexpr double kTeachesS = 10.0;
constexpr double kTaughtS = 30.0;
constexpr double kUnseenBiasSigmas = 4.0;
constexpr double kMisledSpeedMps = 10.0;  // one sigma of a speed that a wheel found wrong had told

}  // namespace

void TrainMotion::block_wheel(const WheelBlock& block) {
  if (std::ranges::find(wheel_.blocks, block) == wheel_.blocks.end()) wheel_.blocks.push_back(block);
}

void TrainMotion::isolate_wheel() {
  sensors_[Source::wheel].isolate(stamp_ns_);
  wheel_.good_windows = 0;
  wheel_.window_begin_ns = filter_.stamp_ns();
  wheel_.window_m.reset();
  wheel_.camera_agrees = false;
  slip_watch_.no_picture();
  // On trial it was wrong all the time, not since a second ago, and the speed at which the camera came back was its
  // own.
  const bool failed_trial = wheel_.on_trial && sensors_.camera_sees();
  if (failed_trial) filter_.loosen_speed(kMisledSpeedMps);
  slip_began_ = !failed_trial;
  wheel_.on_trial = false;
}

void TrainMotion::use(const WheelInput& sample) {
  auto& watch = sensors_[Source::wheel];
  if (!watch.isolated) doubt_time(Source::wheel, pulses_, sample.stamp_ns);
  const int64_t before_ns = std::exchange(watch.seen_ns, sample.stamp_ns);
  const auto reading = wheel_odometer_.read(sample);
  slip_watch_.wheel(sample.stamp_ns, reading.odometer_m);
  doubt_silent_wheel(before_ns, reading.way_m);
  std::erase_if(wheel_.blocks, [&](const WheelBlock& block) { return block.until_ns < sample.stamp_ns; });
  if (std::ranges::any_of(wheel_.blocks, [&](const WheelBlock& b) { return b.from_ns < sample.stamp_ns; })) {
    isolate_wheel();
    slip_began_ = false;
  }
  use_reading(sample.stamp_ns, reading, before_ns);
  watch_alone(reading.way_m, before_ns == 0 ? 0.0 : core::seconds(sample.stamp_ns - before_ns));
}

void TrainMotion::use_reading(int64_t stamp_ns, const WheelReading& reading, int64_t before_ns) {
  auto& watch = sensors_[Source::wheel];
  if (reading.is_first) {
    if (filter_.unit() == Odometer::none) filter_.choose_unit(Odometer::wheel);
    restart_wheel(stamp_ns, reading);
  } else if (watch.isolated) {
    recover_wheel(stamp_ns, reading);
  } else if (offer(Source::wheel, stamp_ns, [&](MotionFilter& filter) {
               return filter.offer_wheel(reading.odometer_m, reading.sigma_m, parameters_->gate_wheel);
             }).used) {
    if (!sensors_.has_any_counted()) filter_.doubt_first_speed(Odometer::wheel, core::seconds(stamp_ns - before_ns));
    watch.accept(stamp_ns);
    unchecked_m_ = 0;
    gap_.counted_since(wheel_.counts_since_ns);
  } else if (++watch.refused >= kRefusalsToIsolate) {
    isolate_wheel();
  }
}

// What it counted while it was silent may have a slip in it. When every sensor was silent it is the clock that is
// asked.
void TrainMotion::doubt_silent_wheel(int64_t silent_since_ns, double way_m) {
  if (silent_since_ns == 0) return;
  if (core::seconds(stamp_ns_ - silent_since_ns) < std::max(kSilentS, 5 * pulses_.period_s())) return;
  if (gap_.begin_ns() >= silent_since_ns) return;
  filter_.doubt_wheel(kSilentSlip * std::abs(way_m));
}

void TrainMotion::watch_alone(double way_m, double dt_s) {
  unwatched_.count({.way_m = way_m,
                    .scale = filter_.scale(Odometer::wheel),
                    .time_s = dt_s,
                    .distance_m = distance_m(),
                    .speed_mps = filter_.speed_mps(),
                    .unseen_share = unseen_share(),
                    .isolated = sensors_[Source::wheel].isolated,
                    .watched = is_watched(),
                    .alone = wheel_is_alone(),
                    .came_back = slipped_unseen() && !sensors_.camera_sees()},
                   *parameters_);
}

bool TrainMotion::wheel_is_alone() const {
  return !sensors_.camera_sees() && !sensors_.used_lately(Source::imu);
}

// A camera sees every slip; what it has taught an IMU is good for some time, unless that was taken back just before. A
// wheel that was seen to slip since then, and has nobody beside it, is not believed when it seems well again.
bool TrainMotion::is_watched() const {
  const int64_t camera_ns = sensors_[Source::camera].used_ns;
  const bool taught = core::seconds(camera_ns - sensors_[Source::imu].changed_ns) > kTeachesS;
  return sensors_.used_within(Source::camera, kTaughtS) && (sensors_.camera_sees() || taught) &&
         !(slipped_unseen() && wheel_is_alone());
}

bool TrainMotion::slipped_unseen() const {
  return sensors_[Source::wheel].changed_ns > sensors_[Source::camera].used_ns;
}

// An IMU sees none that has been there from the beginning, and later as little as it knows its own bias.
double TrainMotion::unseen_share() const {
  if (is_watched()) return 0;
  if (!sensors_.used_lately(Source::imu)) return 1;
  const double slip_s = parameters_->wheel_slip_s;
  const int64_t since_ns = std::max(sensors_[Source::wheel].changed_ns, sensors_.begin_ns());
  if (core::seconds(stamp_ns_ - since_ns) < slip_s) return 1;
  const double unseen_mps = kUnseenBiasSigmas * filter_.sigma(StateIndex::accel_bias) * slip_s;
  return std::min(1.0, unseen_mps / (parameters_->wheel_slip_share * std::abs(filter_.speed_mps()) + 0.01));
}

void TrainMotion::restart_wheel(int64_t stamp_ns, const WheelReading& reading) {
  wheel_.counts_since_ns = stamp_ns;
  filter_.restart_wheel(reading.odometer_m, reading.sigma_m);
}

// The camera may have strayed and the wheel was blamed for it: where what it counted meanwhile is no further off than
// that, it is used for that time, too.
void TrainMotion::take_wheel_back(int64_t stamp_ns, const WheelReading& reading) {
  auto& watch = sensors_[Source::wheel];
  const bool briefly = core::seconds(stamp_ns - watch.changed_ns) < kBrieflyS;
  if (!briefly || !filter_.offer_wheel(reading.odometer_m, reading.sigma_m, kSlipTestSigmas).used) {
    restart_wheel(stamp_ns, reading);
  }
  watch.accept(stamp_ns);
}

// While the wheel slips its odometer is only compared, window by window; two good windows in which it turned end the
// slip: a wheel that is stuck agrees with every train that stands. Where there is no camera it must be taken as it is.
void TrainMotion::recover_wheel(int64_t stamp_ns, const WheelReading& reading) {
  if (sensors_.camera_sees()) {
    if (wheel_.camera_agrees) take_wheel_back(stamp_ns, reading);
    return;
  }
  const auto begin_window = [&] {
    wheel_.window_begin_ns = stamp_ns;
    wheel_.window_m = reading.odometer_m;
    restart_wheel(stamp_ns, reading);
  };
  if (wheel_.window_begin_ns >= stamp_ns || !wheel_.window_m) begin_window();
  if (core::seconds(stamp_ns - wheel_.window_begin_ns) < kSlipWindowS) return;
  MotionFilter trial = filter_;
  const bool good = trial.offer_wheel(reading.odometer_m, reading.sigma_m, kSlipTestSigmas).used;
  const auto& camera = sensors_[Source::camera];
  const bool with_camera = camera.seen_ns != 0 && !sensors_.silent(Source::camera, parameters_->sensor_timeout_s);
  const bool turns = std::abs(reading.odometer_m - *wheel_.window_m) >= kRecoveryWayM;
  if (with_camera && good && !turns) return;
  wheel_.good_windows = good ? wheel_.good_windows + 1 : 0;
  // Without a camera for so long nothing knows the speed better than a wheel that turns.
  const int64_t since_ns = std::max(sensors_[Source::wheel].changed_ns, camera.used_ns);
  const bool alone = !is_watched() && core::seconds(stamp_ns - since_ns) > MotionSensors::kBridgeS;
  if (alone && turns && !good) filter_.loosen_speed(kMisledSpeedMps);
  begin_window();
  if (wheel_.good_windows < kGoodWindows && !(alone && turns)) return;
  sensors_[Source::wheel].accept(stamp_ns);
  wheel_.on_trial = !sensors_.camera_sees();
  // It tells how fast the train is from now on, not how far the IMU was out before.
  if (wheel_.on_trial) filter_.loosen_speed(filter_.sigma(StateIndex::speed));
}

}  // namespace railfix::fusion
