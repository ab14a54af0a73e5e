// The IMU: acceleration, which bridges what camera and wheel do not see, and whether its gyro is to be believed.
#include <cmath>
#include <utility>

#include "core/time.hpp"
#include "core/units.hpp"
#include "fusion/train_motion.hpp"

namespace railfix::fusion {
namespace {

constexpr int kAgreementsOfImu = 60;
constexpr int kRepeatedSamples = 10;  // and for ...
constexpr double kRepeatedS = 0.15;   // ... so long, as map_matcher's gyro (gyro_turn)

}  // namespace

std::optional<YawRate> TrainMotion::use(const ImuInput& sample, const track::Path* path) {
  sensors_[Source::imu].seen_ns = sample.stamp_ns;
  accelerometer_.repeated.add(sample.accel_x_mps2, sample.stamp_ns);
  const auto accel_mps2 = accelerometer_.mean.add(sample.stamp_ns, sample.accel_x_mps2, parameters_->imu_period_s);
  if (gyro_.mean.begins(sample.stamp_ns)) {
    gyro_.watch.begin_period();
    gyro_.begin_m = distance_m();
  }
  gyro_.watch.add(sample.stamp_ns, sample.rate_z_rps);
  const auto rate_rps = gyro_.mean.add(sample.stamp_ns, sample.rate_z_rps, parameters_->gyro_period_s);
  if (accel_mps2 || rate_rps) predict_to(sample.stamp_ns);
  if (accel_mps2) use_acceleration(*accel_mps2, sample.stamp_ns, path);
  if (!rate_rps) return std::nullopt;
  return judge_gyro(*rate_rps, path);
}

// Where no map tells the grade it hides in the bias, and changes along the way.
void TrainMotion::doubt_grade(const track::Path* path) {
  const bool known = path != nullptr && path->grade_known_at(filter_.path_distance_m());
  const double way_m = std::abs(distance_m() - std::exchange(accelerometer_.graded_m, distance_m()));
  const double sigma_mps2 = core::kGravityMps2 * parameters_->unknown_grade;
  if (std::exchange(accelerometer_.grade_known, known) != known) {
    filter_.doubt_accel_bias(sigma_mps2);
  } else if (!known) {
    filter_.doubt_accel_bias(sigma_mps2 * std::sqrt(way_m / parameters_->unknown_grade_m));
  }
}

void TrainMotion::use_acceleration(double accel_mps2, int64_t stamp_ns, const track::Path* path) {
  auto& imu = sensors_[Source::imu];
  if (accelerometer_.repeated.lasts(kRepeatedSamples, kRepeatedS)) {
    imu.isolate(stamp_ns);
    imu.convicted = true;
    return;
  }
  doubt_grade(path);
  const double grade = accelerometer_.grade_known ? path->at(filter_.path_distance_m()).grade : 0.0;
  const double force_mps2 = accel_mps2 - core::kGravityMps2 * grade / std::hypot(1.0, grade);
  const double sigma_mps2 = parameters_->accel_sigma_mps2;
  const auto offered_to = [&](MotionFilter& filter) {
    return filter.offer_acceleration(force_mps2, sigma_mps2, parameters_->gate_imu);
  };
  // Nobody could contradict it in the dark: with whom it did not agree before is asked for longer.
  imu.convicted = imu.convicted || (imu.isolated && sensors_.in_the_dark());
  if (imu.convicted) {
    if (sensors_.in_the_dark()) return;
    MotionFilter trial = filter_;
    imu.hear(offered_to(trial).used, kAgreementsOfImu, stamp_ns);
  } else if (offer(Source::imu, stamp_ns, offered_to).used) {
    feel(force_mps2, sigma_mps2, imu.used_ns);
    imu.accept(stamp_ns);
  } else if (++imu.refused >= kRefusalsToIsolate) {
    imu.isolate(stamp_ns);
  }
}

// With one odometer alone, of which nobody else knows whether it slips, is stuck or looks at what stands still. On a
// train without a camera that is always so: the first slip would leave room that grows without end.
void TrainMotion::feel(double accel_mps2, double sigma_mps2, int64_t before_ns) {
  const double dt_s = core::seconds(filter_.stamp_ns() - before_ns);
  const bool blind = sensors_[Source::camera].seen_ns != 0 && !sensors_.camera_sees();
  // What was felt goes on when the wheel begins to turn and is found out.
  const bool told = sensors_.measures(Source::wheel) || (sensors_[Source::wheel].isolated && feels_otherwise());
  const bool alone = sensors_.camera_sees() ? !sensors_.measures(Source::wheel) : blind && told;
  const bool goes_on = feels_otherwise() && sensors_.in_the_dark();  // it may come back as wrong as it went
  if ((!alone && !goes_on) || dt_s > MotionSensors::kLatelyS) {
    felt_ = {};
    return;
  }
  if (alone) {
    felt_.add({dt_s, accel_mps2, sigma_mps2, filter_.value(StateIndex::accel_bias),
               filter_.sigma(StateIndex::accel_bias), filter_.speed_mps(), filter_.sigma(StateIndex::speed)});
  } else {
    felt_.pause();
  }
  unwatched_.feel(felt_.faster_mps() * dt_s);
}

// At rest one with coarse steps says the same for long.
YawRate TrainMotion::judge_gyro(double rate_rps, const track::Path* path) {
  using Fault = GyroWatch::Fault;
  auto& watch = gyro_.watch;
  const double period_s = parameters_->gyro_period_s;
  const double way_m = distance_m() - gyro_.begin_m;
  GyroWatch::Turned turned{period_s, way_m, rate_rps * period_s, parameters_->gyro_sigma_rps * period_s};
  if (stands()) {
    watch.rest(turned);
    return {.rps = rate_rps, .believed = watch.fault() == Fault::none || watch.fault() == Fault::contradicted};
  }
  if (path != nullptr && filter_.path_sigma_m() < kCurvatureSigmaM) {
    turned.track_rad = path->at(filter_.path_distance_m() - 0.5 * way_m).curvature_per_m * way_m;
  }
  const bool was_believed = watch.fault() == Fault::none;
  watch.judge(turned, stamp_ns_);
  const bool believed = watch.fault() == Fault::none;
  return {.rps = rate_rps, .believed = believed, .just_failed = was_believed && !believed};
}

}  // namespace railfix::fusion
