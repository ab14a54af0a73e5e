// Camera and wheel: what measures the motion, and who is believed where they contradict each other.
#include <algorithm>
#include <cmath>
#include <utility>

#include "core/time.hpp"
#include "fusion/estimator.hpp"

namespace railfix::fusion {
namespace {

constexpr int kRefusalsToDoubt = 10;
constexpr int kAgreementsOfCamera = 10;
constexpr double kRecoveryWayM = 1.0;  // a wheel shows by turning that it is well again
constexpr double kRecoveryS = 0.9;     // beside a camera ...
constexpr double kTurnsM = 0.3;
constexpr double kBrieflyS = 5.0;
constexpr double kSlipWindowS = 0.5;
constexpr int kGoodWindows = 2;
constexpr double kSlipTestSigmas = 3.0;
constexpr double kSlipSigmas = 4.5;
constexpr double kSilentS = 1.0;
constexpr double kSilentSlip = 0.1;  // share of the way
constexpr double kTeachesS = 10.0;
constexpr double kTaughtS = 30.0;
constexpr double kSleeperM = 0.7;  // one more or less: the odd error of a step
constexpr double kUnseenBiasSigmas = 4.0;
constexpr double kMisledSpeedMps = 10.0;  // one sigma of a speed that a wheel found wrong had told

}  // namespace

Offer Estimator::offer_motion(Source source, int64_t stamp_ns, const std::function<Offer(MotionFilter&)>& offering) {
  const Offer offer = offering(filter_);
  if (offer.used) {
    sudden_change_.agreed(source, stamp_ns);
    return offer;
  }
  MotionFilter changed = filter_;
  changed.doubt_acceleration(sudden_change_.since_s(stamp_ns), SuddenChange::kSigmaMps2);
  const Offer again = offering(changed);
  if (!again.used || !sudden_change_.called(source, stamp_ns, offer.residual > 0)) return offer;
  filter_ = std::move(changed);
  return again;
}

void Estimator::use(const PictureInput& picture) {
  filter_.clone_now(picture.stamp_ns);
}

void Estimator::use(const OdometryInput& step) {
  auto& camera = watched(Source::camera);
  gyro_watch_.add(step);
  if (step.valid) doubt_time(camera, pictures_, step.stamp_ns);
  camera.seen_ns = step.stamp_ns;
  if (step.valid) {
    if (filter_.unit() == Odometer::none) filter_.choose_unit(Odometer::camera);
    const double sigma_m = std::hypot(step.step_sigma_m, parameters_->step_sigma_floor_m);
    const double dt_s = core::seconds(step.stamp_ns - step.reference_stamp_ns);
    // Without the reference picture's clone the step is a mean speed, less sure by what the train may have changed it.
    const auto offered_to = [&](MotionFilter& filter) {
      return filter.has_clone(step.reference_stamp_ns)
                 ? filter.offer_step(step.reference_stamp_ns, step.step_m, sigma_m, parameters_->gate_camera)
                 : filter.offer_speed(step.step_m / dt_s, sigma_m / dt_s + 0.5 * dt_s, parameters_->gate_camera);
    };
    const bool alone = !used_within(Source::wheel, kLatelyS) || wheel_.on_trial;
    if (camera.isolated && !(alone && !used_within(Source::imu, kLatelyS))) {
      slip_watch_.no_picture();
      MotionFilter trial = filter_;
      const auto offer = offered_to(trial);
      camera.hear(offer.used, kAgreementsOfCamera, step.stamp_ns);
      if (alone) doubts_.odometers_m += std::abs(offer.residual);
    } else if (const auto offer = offer_motion(Source::camera, step.stamp_ns, offered_to); offer.used) {
      const bool is_first = nobody_measured();
      unchecked_m_ = is_first ? kSleeperM : 0;
      if (is_first) filter_.doubt_first_speed(Odometer::camera, dt_s);
      camera.accept(step.stamp_ns);
      if (filter_.has_clone(step.reference_stamp_ns)) gap_.counted_since(step.reference_stamp_ns);
      compare_with_wheel(step, sigma_m);
    } else {
      slip_watch_.no_picture();
      // One that is refused now and then always says the same where the film has pictures twice.
      if (alone) unwatched_.refuse_step(offer.residual);
      if (++camera.refused >= kRefusalsToIsolate && !blame_wheel_on_trial()) {
        if (alone && !camera.isolated) doubts_.odometers_m += camera.refused * std::abs(offer.residual);
        camera.isolate(step.stamp_ns);
      }
      // With the wheel the rivals' ends are wide enough; without it nobody knows who is right.
      if (camera.refused >= kRefusalsToDoubt && alone) doubts_.odometers_m += std::abs(offer.residual);
    }
  }
  if (!step.valid) slip_watch_.no_picture();
  filter_.clone_now(step.reference_stamp_ns);
}

// The camera is back and finds a speed that a wheel on trial had told.
bool Estimator::blame_wheel_on_trial() {
  if (!wheel_.on_trial || watch(Source::wheel).isolated || watch(Source::camera).isolated) return false;
  isolate_wheel();
  watched(Source::camera).refused = 0;
  return true;
}

void Estimator::compare_with_wheel(const OdometryInput& step, double sigma_m) {
  const auto ways = slip_watch_.picture(step);
  if (!ways) return;
  const double visual_m = ways->visual_m * filter_.to_unit(Odometer::camera);
  const double wheel_m = ways->wheel_m * filter_.to_unit(Odometer::wheel);
  const double noise_m = std::hypot(sigma_m * std::sqrt(ways->steps), wheel_.odometer.resolution_m());
  const double known_m = filter_.sigma(StateIndex::other_scale) * std::abs(visual_m);
  const double raw_m = std::hypot(parameters_->visual_scale_sigma, parameters_->wheel_scale_sigma) * std::abs(visual_m);
  const bool ratio_moved = std::abs(wheel_m - visual_m) > kSlipSigmas * std::hypot(noise_m, known_m);
  const bool ratio_impossible = std::abs(ways->wheel_m - ways->visual_m) > kSlipSigmas * std::hypot(noise_m, raw_m);
  const bool apart = ratio_moved || ratio_impossible;
  if (watch(Source::wheel).isolated) {
    const bool turns = std::abs(ways->wheel_m) >= kTurnsM;
    wheel_.camera_agrees = !apart && turns && ways->time_s >= kRecoveryS;
  } else if (apart) {
    isolate_wheel();
  } else {
    wheel_.on_trial = false;
  }
}

void Estimator::block_wheel(const WheelBlock& block) {
  if (std::ranges::find(wheel_.blocks, block) == wheel_.blocks.end()) wheel_.blocks.push_back(block);
}

void Estimator::isolate_wheel() {
  watched(Source::wheel).isolate(stamp_ns_);
  wheel_.good_windows = 0;
  wheel_.window_begin_ns = filter_.stamp_ns();
  wheel_.window_m.reset();
  wheel_.camera_agrees = false;
  slip_watch_.no_picture();
  // On trial it was wrong all the time, not since a second ago, and the speed at which the camera came back was its
  // own.
  const bool failed_trial = wheel_.on_trial && sees();
  if (failed_trial) filter_.loosen_speed(kMisledSpeedMps);
  slip_began_ = !failed_trial;
  wheel_.on_trial = false;
}

void Estimator::use(const WheelInput& sample) {
  auto& watch = watched(Source::wheel);
  if (!watch.isolated) doubt_time(watch, pulses_, sample.stamp_ns);
  const int64_t before_ns = std::exchange(watch.seen_ns, sample.stamp_ns);
  const auto reading = wheel_.odometer.read(sample);
  const double wheel_m = reading.odometer_m;
  slip_watch_.wheel(sample.stamp_ns, wheel_m);
  doubt_silent_wheel(before_ns, reading.way_m);
  std::erase_if(wheel_.blocks, [&](const WheelBlock& block) { return block.until_ns < sample.stamp_ns; });
  if (std::ranges::any_of(wheel_.blocks, [&](const WheelBlock& b) { return b.from_ns < sample.stamp_ns; })) {
    isolate_wheel();
    slip_began_ = false;
  }
  if (reading.is_first) {
    if (filter_.unit() == Odometer::none) filter_.choose_unit(Odometer::wheel);
    restart_wheel(sample.stamp_ns, wheel_m, reading.sigma_m);
  } else if (watch.isolated) {
    recover_wheel(sample, wheel_m, reading.sigma_m);
  } else if (offer_motion(Source::wheel, sample.stamp_ns, [&](MotionFilter& filter) {
               return filter.offer_wheel(reading.odometer_m, reading.sigma_m, parameters_->gate_wheel);
             }).used) {
    if (nobody_measured()) filter_.doubt_first_speed(Odometer::wheel, core::seconds(sample.stamp_ns - before_ns));
    watch.accept(sample.stamp_ns);
    unchecked_m_ = 0;
    gap_.counted_since(wheel_.counts_since_ns);
  } else if (++watch.refused >= kRefusalsToIsolate) {
    isolate_wheel();
  }
  watch_alone(reading.way_m, before_ns == 0 ? 0.0 : core::seconds(sample.stamp_ns - before_ns));
}

// What it counted while it was silent may have a slip in it. When every sensor was silent it is the clock that is
// asked.
void Estimator::doubt_silent_wheel(int64_t silent_since_ns, double way_m) {
  if (silent_since_ns == 0 || core::seconds(stamp_ns_ - silent_since_ns) < std::max(kSilentS, 5 * pulses_.period_s()))
    return;
  if (gap_.begin_ns() >= silent_since_ns) return;
  filter_.doubt_wheel(kSilentSlip * std::abs(way_m));
}

void Estimator::watch_alone(double way_m, double dt_s) {
  unwatched_.count({.way_m = way_m,
                    .scale = filter_.scale(Odometer::wheel),
                    .time_s = dt_s,
                    .distance_m = distance_m(),
                    .speed_mps = filter_.speed_mps(),
                    .unseen_share = unwatched_share(),
                    .isolated = watch(Source::wheel).isolated,
                    .watched = is_watched(),
                    .alone = wheel_is_alone(),
                    .came_back = slipped_unseen() && !sees()},
                   *parameters_);
}

bool Estimator::wheel_is_alone() const {
  return !sees() && !used_within(Source::imu, kLatelyS);
}

// A camera sees every slip; what it has taught an IMU is good for some time, unless that was taken back just before. A
// wheel that was seen to slip since then, and has nobody beside it, is not believed when it seems well again.
bool Estimator::is_watched() const {
  const auto& camera = watch(Source::camera);
  const bool taught = core::seconds(camera.used_ns - watch(Source::imu).changed_ns) > kTeachesS;
  return used_within(Source::camera, kTaughtS) && (sees() || taught) && !(slipped_unseen() && wheel_is_alone());
}

bool Estimator::slipped_unseen() const {
  return watch(Source::wheel).changed_ns > watch(Source::camera).used_ns;
}

// An IMU sees none that has been there from the beginning, and later as little as it knows
// its own bias.
double Estimator::unwatched_share() const {
  if (is_watched()) return 0;
  if (!used_within(Source::imu, kLatelyS)) return 1;
  const double slip_s = parameters_->wheel_slip_s;
  if (core::seconds(stamp_ns_ - std::max(watch(Source::wheel).changed_ns, start_ns_)) < slip_s) return 1;
  const double unseen_mps = kUnseenBiasSigmas * filter_.sigma(StateIndex::accel_bias) * slip_s;
  return std::min(1.0, unseen_mps / (parameters_->wheel_slip_share * std::abs(filter_.speed_mps()) + 0.01));
}

void Estimator::restart_wheel(int64_t stamp_ns, double wheel_m, double sigma_m) {
  wheel_.counts_since_ns = stamp_ns;
  filter_.restart_wheel(wheel_m, sigma_m);
}

// The camera may have strayed and the wheel was blamed for it: where what it counted meanwhile is no further off than
// that, it is used for that time, too.
void Estimator::take_wheel_back(int64_t stamp_ns, double wheel_m, double sigma_m) {
  auto& watch = watched(Source::wheel);
  const bool briefly = core::seconds(stamp_ns - watch.changed_ns) < kBrieflyS;
  if (!briefly || !filter_.offer_wheel(wheel_m, sigma_m, kSlipTestSigmas).used) {
    restart_wheel(stamp_ns, wheel_m, sigma_m);
  }
  watch.accept(stamp_ns);
}

// While the wheel slips its odometer is only compared, window by window; two good windows in which it turned end the
// slip: a wheel that is stuck agrees with every train that stands. Where there is no camera it must be taken as it is.
void Estimator::recover_wheel(const WheelInput& sample, double wheel_m, double sigma_m) {
  if (sees()) {
    if (wheel_.camera_agrees) take_wheel_back(sample.stamp_ns, wheel_m, sigma_m);
    return;
  }
  const auto begin_window = [&] {
    wheel_.window_begin_ns = sample.stamp_ns;
    wheel_.window_m = wheel_m;
    restart_wheel(sample.stamp_ns, wheel_m, sigma_m);
  };
  if (wheel_.window_begin_ns >= sample.stamp_ns || !wheel_.window_m) begin_window();
  if (core::seconds(sample.stamp_ns - wheel_.window_begin_ns) < kSlipWindowS) return;
  MotionFilter trial = filter_;
  const bool good = trial.offer_wheel(wheel_m, sigma_m, kSlipTestSigmas).used;
  const bool with_camera = watch(Source::camera).seen_ns != 0 && !silent(Source::camera);
  const bool turns = std::abs(wheel_m - *wheel_.window_m) >= kRecoveryWayM;
  if (with_camera && good && !turns) return;
  wheel_.good_windows = good ? wheel_.good_windows + 1 : 0;
  // Without a camera for so long nothing knows the speed better than a wheel that turns.
  const int64_t since_ns = std::max(watch(Source::wheel).changed_ns, watch(Source::camera).used_ns);
  const bool alone = !is_watched() && core::seconds(sample.stamp_ns - since_ns) > kBridgeS;
  if (alone && turns && !good) filter_.loosen_speed(kMisledSpeedMps);
  begin_window();
  if (wheel_.good_windows < kGoodWindows && !(alone && turns)) return;
  watched(Source::wheel).accept(sample.stamp_ns);
  wheel_.on_trial = !sees();
  // It tells how fast the train is from now on, not how far the IMU was out before.
  if (wheel_.on_trial) filter_.loosen_speed(filter_.sigma(StateIndex::speed));
}

}  // namespace railfix::fusion
