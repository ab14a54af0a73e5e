// The IMU: acceleration, which bridges what camera and wheel do not see, and turning, which tells the legs of a switch
// apart.
#include <algorithm>
#include <cmath>
#include <utility>

#include "core/time.hpp"
#include "core/units.hpp"
#include "fusion/estimator.hpp"

namespace railfix::fusion {
namespace {

constexpr int kAgreementsOfImu = 60;
constexpr int kRepeatedSamples = 10;          // and for ...
constexpr double kRepeatedS = 0.15;           // ... so long, as map_matcher's gyro (gyro_turn)
constexpr double kGyroPositionSigmaM = 30.0;  // within which the curvature may be taken as linear
constexpr double kTurnSigmas = 4.0;
constexpr double kTurnSigmasOfTwo = 2.0;  // without the worst second

}  // namespace

void Estimator::use(const ImuInput& sample) {
  auto& imu = watched(Source::imu);
  imu.seen_ns = sample.stamp_ns;
  accel_repeated_.add(sample.accel_x_mps2, sample.stamp_ns);
  const auto accel_mps2 = accel_.add(sample.stamp_ns, sample.accel_x_mps2, parameters_->imu_period_s);
  if (yaw_.begins(sample.stamp_ns)) {
    gyro_watch_.begin_period();
    judged_m_ = distance_m();
  }
  gyro_watch_.add(sample.stamp_ns, sample.rate_z_rps);
  const auto rate_rps = yaw_.add(sample.stamp_ns, sample.rate_z_rps, parameters_->gyro_period_s);
  if (accel_mps2 || rate_rps) predict_to(sample.stamp_ns);
  if (accel_mps2) use_acceleration(*accel_mps2, sample.stamp_ns);
  if (rate_rps) use_yaw_rate(*rate_rps);
}

// Where no map tells the grade it hides in the bias, and changes along the way.
void Estimator::doubt_grade() {
  const bool known = place_.path && place_.path->grade_known_at(filter_.path_distance_m());
  const double way_m = std::abs(distance_m() - std::exchange(graded_m_, distance_m()));
  const double sigma_mps2 = core::kGravityMps2 * parameters_->unknown_grade;
  if (std::exchange(grade_known_, known) != known) {
    filter_.doubt_accel_bias(sigma_mps2);
  } else if (!known) {
    filter_.doubt_accel_bias(sigma_mps2 * std::sqrt(way_m / parameters_->unknown_grade_m));
  }
}

void Estimator::use_acceleration(double accel_mps2, int64_t stamp_ns) {
  auto& imu = watched(Source::imu);
  if (accel_repeated_.lasts(kRepeatedSamples, kRepeatedS)) {
    imu.isolate(stamp_ns);
    imu.convicted = true;
    return;
  }
  doubt_grade();
  const double grade = grade_known_ ? place_.path->at(filter_.path_distance_m()).grade : 0.0;
  const double force_mps2 = accel_mps2 - core::kGravityMps2 * grade / std::hypot(1.0, grade);
  const double sigma_mps2 = parameters_->accel_sigma_mps2;
  // Nobody could contradict it in the dark: with whom it did not agree before is asked for longer.
  imu.convicted = imu.convicted || (imu.isolated && in_the_dark());
  if (imu.convicted) {
    if (in_the_dark()) return;
    MotionFilter trial = filter_;
    imu.hear(trial.offer_acceleration(force_mps2, sigma_mps2, parameters_->gate_imu).used, kAgreementsOfImu, stamp_ns);
    return;
  }
  const auto offer = offer_motion(Source::imu, stamp_ns, [&](MotionFilter& filter) {
    return filter.offer_acceleration(force_mps2, sigma_mps2, parameters_->gate_imu);
  });
  if (offer.used) {
    feel(force_mps2, sigma_mps2, imu.used_ns);
    imu.accept(stamp_ns);
  } else if (++imu.refused >= kRefusalsToIsolate) {
    imu.isolate(stamp_ns);
  }
}

// With one odometer alone, of which nobody else knows whether it slips, is stuck or looks at what stands still. On a
// train without a camera that is always so: the first slip would leave room that grows without end.
void Estimator::feel(double accel_mps2, double sigma_mps2, int64_t before_ns) {
  const double dt_s = core::seconds(filter_.stamp_ns() - before_ns);
  const bool blind = watch(Source::camera).seen_ns != 0 && !sees();
  // What was felt goes on when the wheel begins to turn and is found out.
  const bool told = measures(Source::wheel) || (watch(Source::wheel).isolated && felt_.faster_mps() != 0);
  const bool alone = sees() ? !measures(Source::wheel) : blind && told;
  const bool goes_on = felt_.faster_mps() != 0 && in_the_dark();  // it may come back as wrong as it went
  if ((!alone && !goes_on) || dt_s > kLatelyS) {
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

// The mean belongs to the middle of its period, which lies v * period / 2 behind.
void Estimator::use_yaw_rate(double rate_rps) {
  const double speed_mps = filter_.speed_mps();
  const double speed_sigma_mps = filter_.sigma(StateIndex::speed);
  if (!judge_gyro(rate_rps)) {
    place_.turned_way.clear();
    return;
  }
  if (standstill_.stands()) {
    filter_.offer_yaw_rate(rate_rps, 0, 0, parameters_->gyro_sigma_rps, parameters_->gate_gyro);
    return;
  }
  if (!place_.path || filter_.path_sigma_m() > kGyroPositionSigmaM || speed_sigma_mps > 1) {
    place_.turned_way.clear();
    return;
  }
  remember_turn(rate_rps, speed_mps);
  const auto point = place_.path->at(filter_.path_distance_m() - 0.5 * speed_mps * parameters_->gyro_period_s);
  // A tenth of the curvature covers the map's error, which is the same for a whole curve.
  const double sigma_rps =
      parameters_->gyro_sigma_rps + std::abs(point.curvature_per_m) * (0.1 * std::abs(speed_mps) + speed_sigma_mps);
  const auto offer = filter_.offer_yaw_rate(rate_rps, point.curvature_per_m, point.curvature_rate_per_m2, sigma_rps,
                                            parameters_->gate_gyro);
  const bool bends = std::abs(speed_mps * point.curvature_per_m) > parameters_->gate_gyro * sigma_rps;
  place_.track_doubt.turned(offer.used, bends);
  compare_turns();
}

// At rest one with coarse steps says the same for long.
bool Estimator::judge_gyro(double rate_rps) {
  const double period_s = parameters_->gyro_period_s;
  const double way_m = distance_m() - judged_m_;
  GyroWatch::Turned turned{period_s, way_m, rate_rps * period_s, parameters_->gyro_sigma_rps * period_s};
  if (standstill_.stands()) {
    gyro_watch_.rest(turned);
    return gyro_watch_.fault() == GyroWatch::Fault::none || gyro_watch_.fault() == GyroWatch::Fault::contradicted;
  }
  if (place_.path && filter_.path_sigma_m() < kGyroPositionSigmaM) {
    const auto point = place_.path->at(filter_.path_distance_m() - 0.5 * way_m);
    turned.track_rad = point.curvature_per_m * way_m;
  }
  const bool was_believed = gyro_watch_.fault() == GyroWatch::Fault::none;
  gyro_watch_.judge(turned, stamp_ns_);
  const bool believed = gyro_watch_.fault() == GyroWatch::Fault::none;
  if (was_believed && !believed) place_.track_doubt.changed();  // it has spoken against the track
  return believed;
}

void Estimator::remember_turn(double rate_rps, double speed_mps) {
  const double period_s = parameters_->gyro_period_s;
  const double here_m = filter_.path_distance_m();
  place_.turned_way.add({here_m - speed_mps * period_s, here_m,
                         (rate_rps - filter_.value(StateIndex::gyro_bias)) * period_s,
                         parameters_->gyro_sigma_rps * period_s, period_s});
}

// Where no switch was run over there is no other leg, and where the place is in doubt its turns say nothing. One mast
// may stand beside both legs: as long as the points are among what is remembered, having seen it says less than the
// turns.
void Estimator::compare_turns() {
  const auto points_m = place_.track_doubt.divided_at_m();
  const bool passed = points_m && place_.turned_way.holds(*points_m);
  if (place_.wrong_place.lost() || (!place_.track_doubt.divided() && !passed)) return;
  const auto known = widened(interval());
  const double half_m = 0.5 * (known.front_m - known.rear_m);
  const double place_m = std::max(filter_.path_sigma_m(), half_m / parameters_->interval_factor);
  const auto misfit = place_.turned_way.misfit(*place_.path, {filter_.sigma(StateIndex::gyro_bias), place_m});
  if (misfit.most > kTurnSigmas && misfit.without_worst > kTurnSigmasOfTwo) place_.track_doubt.turned_elsewhere();
}

}  // namespace railfix::fusion
