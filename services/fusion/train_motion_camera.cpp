// The camera: its steps, whether they are believed, and whether the wheel beside it slips.
#include <cmath>

#include "core/time.hpp"
#include "fusion/train_motion.hpp"

namespace railfix::fusion {
namespace {

constexpr int kRefusalsToDoubt = 10;
constexpr int kAgreementsOfCamera = 10;
constexpr double kRecoveryS = 0.9;  // of a wheel beside a camera ...
constexpr double kTurnsM = 0.3;     // ... if it turns
constexpr double kSlipSigmas = 4.5;
constexpr double kSleeperM = 0.7;  // one more or less: the odd error of a step

}  // namespace

void TrainMotion::use(const PictureInput& picture) {
  filter_.clone_now(picture.stamp_ns);
}

void TrainMotion::use(const OdometryInput& step) {
  gyro_.watch.add(step);
  if (step.valid) doubt_time(Source::camera, pictures_, step.stamp_ns);
  sensors_[Source::camera].seen_ns = step.stamp_ns;
  if (step.valid) {
    use_valid(step);
  } else {
    slip_watch_.no_picture();
  }
  filter_.clone_now(step.reference_stamp_ns);
}

void TrainMotion::use_valid(const OdometryInput& step) {
  if (filter_.unit() == Odometer::none) filter_.choose_unit(Odometer::camera);
  const double sigma_m = std::hypot(step.step_sigma_m, parameters_->step_sigma_floor_m);
  const double dt_s = core::seconds(step.stamp_ns - step.reference_stamp_ns);
  // Without the reference picture's clone the step is a mean speed, less sure by what the train may have changed it.
  const auto offered_to = [&](MotionFilter& filter) {
    return filter.has_clone(step.reference_stamp_ns)
               ? filter.offer_step(step.reference_stamp_ns, step.step_m, sigma_m, parameters_->gate_camera)
               : filter.offer_speed(step.step_m / dt_s, sigma_m / dt_s + 0.5 * dt_s, parameters_->gate_camera);
  };
  auto& camera = sensors_[Source::camera];
  const bool alone = !sensors_.used_lately(Source::wheel) || wheel_.on_trial;
  if (camera.isolated && !(alone && !sensors_.used_lately(Source::imu))) {
    slip_watch_.no_picture();
    MotionFilter trial = filter_;
    const auto offer = offered_to(trial);
    camera.hear(offer.used, kAgreementsOfCamera, step.stamp_ns);
    if (alone) odometers_apart_m_ += std::abs(offer.residual);
  } else if (const auto offer = this->offer(Source::camera, step.stamp_ns, offered_to); offer.used) {
    accept_step(step, sigma_m);
  } else {
    refuse_step(step.stamp_ns, offer.residual, alone);
  }
}

void TrainMotion::accept_step(const OdometryInput& step, double sigma_m) {
  const bool is_first = !sensors_.has_any_counted();
  unchecked_m_ = is_first ? kSleeperM : 0;
  if (is_first) filter_.doubt_first_speed(Odometer::camera, core::seconds(step.stamp_ns - step.reference_stamp_ns));
  sensors_[Source::camera].accept(step.stamp_ns);
  if (filter_.has_clone(step.reference_stamp_ns)) gap_.counted_since(step.reference_stamp_ns);
  compare_with_wheel(step, sigma_m);
}

void TrainMotion::refuse_step(int64_t stamp_ns, double off_m, bool alone) {
  auto& camera = sensors_[Source::camera];
  slip_watch_.no_picture();
  // One that is refused now and then always says the same where the film has pictures twice.
  if (alone) unwatched_.refuse_step(off_m);
  if (++camera.refused >= kRefusalsToIsolate && !blame_wheel_on_trial()) {
    if (alone && !camera.isolated) odometers_apart_m_ += camera.refused * std::abs(off_m);
    camera.isolate(stamp_ns);
  }
  // With the wheel the rivals' ends are wide enough; without it nobody knows who is right.
  if (camera.refused >= kRefusalsToDoubt && alone) odometers_apart_m_ += std::abs(off_m);
}

void TrainMotion::compare_with_wheel(const OdometryInput& step, double sigma_m) {
  const auto ways = slip_watch_.picture(step);
  if (!ways) return;
  const double visual_m = ways->visual_m * filter_.to_unit(Odometer::camera);
  const double wheel_m = ways->wheel_m * filter_.to_unit(Odometer::wheel);
  const double noise_m = std::hypot(sigma_m * std::sqrt(ways->steps), wheel_odometer_.resolution_m());
  const double known_m = filter_.sigma(StateIndex::other_scale) * std::abs(visual_m);
  const double raw_m = std::hypot(parameters_->visual_scale_sigma, parameters_->wheel_scale_sigma) * std::abs(visual_m);
  const bool ratio_moved = std::abs(wheel_m - visual_m) > kSlipSigmas * std::hypot(noise_m, known_m);
  const bool ratio_impossible = std::abs(ways->wheel_m - ways->visual_m) > kSlipSigmas * std::hypot(noise_m, raw_m);
  const bool apart = ratio_moved || ratio_impossible;
  if (sensors_[Source::wheel].isolated) {
    const bool turns = std::abs(ways->wheel_m) >= kTurnsM;
    wheel_.camera_agrees = !apart && turns && ways->time_s >= kRecoveryS;
  } else if (apart) {
    isolate_wheel();
  } else {
    wheel_.on_trial = false;
  }
}

// The camera is back and finds a speed that a wheel on trial had told.
bool TrainMotion::blame_wheel_on_trial() {
  if (!wheel_.on_trial || sensors_[Source::wheel].isolated || sensors_[Source::camera].isolated) return false;
  isolate_wheel();
  sensors_[Source::camera].refused = 0;
  return true;
}

}  // namespace railfix::fusion
