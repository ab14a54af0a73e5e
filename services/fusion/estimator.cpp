#include "fusion/estimator.hpp"

#include <algorithm>
#include <cmath>

#include "core/time.hpp"
#include "core/units.hpp"

namespace railfix::fusion {
namespace {

constexpr int kRefusalsToIsolate = 3;
constexpr int kRefusalsToDoubt = 10;
constexpr int kAgreementsOfCamera = 10;
constexpr int kAgreementsOfImu = 60;
constexpr int kRepeatedSamples = 10;  // and for ...
constexpr double kRepeatedS = 0.15;   // ... so long
constexpr double kAtWorkS = 0.3;
constexpr double kRecoveryWayM = 1.0;  // a wheel shows by turning that it is well again
constexpr double kSlipWindowS = 0.5;
constexpr int kGoodWindows = 2;
constexpr double kSlipTestSigmas = 3.0;
constexpr double kSlipSigmas = 4.5;
constexpr double kRestM = 0.05;  // a train that moved less than this ...
constexpr double kRestS = 1.0;   // ... for so long stands still
constexpr double kRestSpeedSigmaMps = 0.3;
constexpr double kGyroPositionSigmaM = 30.0;  // within which the curvature may be taken as linear
constexpr double kLatelyS = 1.0;
constexpr double kBridgeS = 10.0;  // as long as the IMU alone is good for a place
constexpr double kRebaseS = 0.1;   // lost when the clock is set
constexpr double kRhythmS = 0.003;
constexpr double kGapS = 0.05;
constexpr int kRhythmSamples = 10;
constexpr double kOffTrackM = 15.0;  // a GNSS fix further beside the track is none

double gnss_sigma_m(const GnssInput& sample, const FusionParameters& p) {
  const double hdop = std::max(sample.hdop, 0.5);
  if (sample.fix == 4) return p.gnss_rtk_fixed_sigma_m * hdop;
  if (sample.fix == 5) return p.gnss_rtk_float_sigma_m * hdop;
  return p.gnss_single_sigma_m * hdop;
}

struct Projection {
  double distance_m;
  double lateral_m;
};

// Newton steps along the path; converges in two or three because the start is near.
Projection project(const track::Path& path, double start_m, double easting_m, double northing_m) {
  double s = start_m;
  double lateral_m = 0;
  for (int k = 0; k < 6; ++k) {
    const auto pose = path.at(s).pose;
    const double east = easting_m - pose.easting_m;
    const double north = northing_m - pose.northing_m;
    const double sine = std::sin(pose.heading_rad);
    const double cosine = std::cos(pose.heading_rad);
    const double ahead = east * sine + north * cosine;
    lateral_m = north * sine - east * cosine;
    s = std::clamp(s + ahead, path.begin_m(), path.end_m());
    if (std::abs(ahead) < 1e-3) break;
  }
  return {s, lateral_m};
}

}  // namespace

Estimator::Estimator(const FusionParameters* parameters, std::shared_ptr<const track::Path> path, int64_t stamp_ns)
    : parameters_(parameters),
      path_(std::move(path)),
      filter_(*parameters, stamp_ns, path_ != nullptr),
      stamp_ns_(stamp_ns),
      rest_since_ns_(stamp_ns),
      start_ns_(stamp_ns) {}

void Estimator::predict_to(int64_t stamp_ns) {
  filter_.predict_to(stamp_ns, *parameters_);
}

void Estimator::rebase_clock(int64_t stamp_ns) {
  filter_.rebase_clock(stamp_ns);
  stamp_ns_ = stamp_ns;
  for (auto& watch : watches_) {
    watch.seen_ns = std::min(watch.seen_ns, stamp_ns);
    watch.used_ns = std::min(watch.used_ns, stamp_ns);
    watch.changed_ns = std::min(watch.changed_ns, stamp_ns);
  }
  accel_ = {};
  yaw_ = {};
  wheel_.blocked_until_ns = wheel_.window_begin_ns = 0;
  filter_.doubt_way(filter_.value(StateIndex::speed) * kRebaseS);
  slip_watch_ = {};
  sudden_change_ = {};
  rest_since_ns_ = stamp_ns;
  start_ns_ = std::min(start_ns_, stamp_ns);
}

void Estimator::apply(const Event& event) {
  slip_began_ = false;
  fix_verdict_ = FixVerdict::none;
  notice_gap(std::visit([](const auto& input) { return input.stamp_ns; }, event));
  std::visit(
      [this](const auto& input) {
        // Inertial samples are many and only their mean is used: they move the filter when it is complete.
        if constexpr (!std::is_same_v<std::decay_t<decltype(input)>, ImuInput>) predict_to(input.stamp_ns);
        stamp_ns_ = std::max(stamp_ns_, input.stamp_ns);
        use(input);
      },
      event);
  if (path_) track_doubt_.move(*path_, filter_.path_distance_m());
  watch_standstill();
}

bool Estimator::used_within(Source source, double time_s) const {
  const auto& w = watch(source);
  return w.used_ns != 0 && !w.isolated && core::seconds(filter_.stamp_ns() - w.used_ns) < time_s;
}

bool Estimator::knows_motion() const {
  const bool lately = used_within(Source::camera, kBridgeS) || used_within(Source::wheel, kBridgeS);
  return used_within(Source::camera, kLatelyS) || used_within(Source::wheel, kLatelyS) ||
         (lately && used_within(Source::imu, kLatelyS));
}

// A sample that comes out of rhythm may have another clock behind it: then the way run by time alone is in doubt by as
// much, and the sample itself says how far the train ran.
void Estimator::doubt_time(const SensorWatch& watch, Rhythm& rhythm, int64_t stamp_ns) {
  if (watch.seen_ns == 0 || stamp_ns <= watch.seen_ns) return;
  const double dt_s = core::seconds(stamp_ns - watch.seen_ns);
  const double off_s = std::abs(dt_s - rhythm.period_s);
  if (rhythm.samples >= kRhythmSamples && off_s > std::max(kRhythmS, 0.1 * rhythm.period_s)) {
    filter_.doubt_way(filter_.value(StateIndex::speed) * off_s);
  } else {
    rhythm.period_s += (dt_s - rhythm.period_s) / std::min(++rhythm.samples, 20);
  }
}

bool Estimator::is_consistent(uint32_t excepted) const {
  return std::ranges::none_of(kMotionSources, [&](Source source) {
    return watch(source).isolated && (excepted & 1U << static_cast<unsigned>(source)) == 0;
  });
}

int Estimator::sensors_at_work() const {
  return static_cast<int>(
      std::ranges::count_if(kMotionSources, [&](Source source) { return used_within(source, kAtWorkS); }));
}

void Estimator::exclude(Source source, const Estimator& other) {
  watched(source) = other.watch(source);
  watched(source).isolated = false;
  watched(source).isolate(stamp_ns_);
  watched(source).convicted = true;
  slip_began_ = false;
  if (source == Source::camera) pictures_ = other.pictures_;
  if (source == Source::imu) accel_repeated_ = other.accel_repeated_;
  if (source != Source::wheel) return;
  pulses_ = other.pulses_;
  wheel_ = other.wheel_;
  wheel_.good_windows = 0;
  wheel_.window_begin_ns = filter_.stamp_ns();
  wheel_.window_m.reset();
}

void Estimator::place_like(const Estimator& other) {
  path_ = other.path_;
  track_doubt_ = other.track_doubt_;
  filter_.place_like(other.filter_);
  doubt_m_ = std::max(doubt_m_, other.doubt_m_);
  time_doubt_m_ = std::max(time_doubt_m_, other.time_doubt_m_);
  reference_ = other.reference_;
}

// Nothing from any sensor for a while: the clock may have been set forward. What counts way over the gap tells.
void Estimator::notice_gap(int64_t stamp_ns) {
  const double gap_s = core::seconds(stamp_ns - stamp_ns_);
  if (gap_s <= 0) return;
  if (events_.samples >= kRhythmSamples && gap_s > std::max(kGapS, 5 * events_.period_s)) {
    time_doubt_m_ += std::abs(filter_.speed_mps()) * gap_s;
    gap_begin_ns_ = stamp_ns_;
  } else {
    events_.period_s += (gap_s - events_.period_s) / std::min(++events_.samples, 50);
  }
}

template <typename Offering>
Offer Estimator::offer_motion(Source source, int64_t stamp_ns, const Offering& offering) {
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
  if (step.valid) doubt_time(camera, pictures_, step.stamp_ns);
  camera.seen_ns = step.stamp_ns;
  if (step.valid) {
    if (filter_.unit() == Odometer::none) filter_.choose_unit(Odometer::camera, *parameters_);
    const double sigma_m = std::hypot(step.step_sigma_m, parameters_->step_sigma_floor_m);
    const double dt_s = core::seconds(step.stamp_ns - step.reference_stamp_ns);
    // Without the reference picture's clone the step is a mean speed, less sure by what the train may have changed it.
    const auto offered_to = [&](MotionFilter& filter) {
      return filter.has_clone(step.reference_stamp_ns)
                 ? filter.offer_step(step.reference_stamp_ns, step.step_m, sigma_m, parameters_->gate_camera)
                 : filter.offer_speed(step.step_m / dt_s, sigma_m / dt_s + 0.5 * dt_s, parameters_->gate_camera);
    };
    const bool alone = !used_within(Source::wheel, kLatelyS);
    if (camera.isolated && !(alone && !used_within(Source::imu, kLatelyS))) {
      slip_watch_.no_picture();
      MotionFilter trial = filter_;
      const auto offer = offered_to(trial);
      camera.hear(offer.used, kAgreementsOfCamera, step.stamp_ns);
      if (alone) doubt_m_ += std::abs(offer.residual);
    } else if (const auto offer = offer_motion(Source::camera, step.stamp_ns, offered_to); offer.used) {
      camera.accept(step.stamp_ns);
      if (step.reference_stamp_ns <= gap_begin_ns_ && filter_.has_clone(step.reference_stamp_ns)) time_doubt_m_ = 0;
      compare_with_wheel(step, sigma_m);
    } else {
      slip_watch_.no_picture();
      if (++camera.refused >= kRefusalsToIsolate) camera.isolate(step.stamp_ns);
      // With the wheel the rivals' ends are wide enough; without it nobody knows who is right.
      if (camera.refused >= kRefusalsToDoubt && alone) doubt_m_ += std::abs(offer.residual);
    }
  }
  if (!step.valid) slip_watch_.no_picture();
  filter_.clone_now(step.reference_stamp_ns);
}

void Estimator::compare_with_wheel(const OdometryInput& step, double sigma_m) {
  const auto ways = slip_watch_.picture(step);
  if (!ways || watch(Source::wheel).isolated) return;
  const double visual_m = ways->visual_m * filter_.to_unit(Odometer::camera);
  const double wheel_m = ways->wheel_m * filter_.to_unit(Odometer::wheel);
  const double noise_m = std::hypot(sigma_m * std::sqrt(ways->steps), wheel_.resolution_m);
  const double known_m = filter_.sigma(StateIndex::other_scale) * std::abs(visual_m);
  const double raw_m = std::hypot(parameters_->visual_scale_sigma, parameters_->wheel_scale_sigma) * std::abs(visual_m);
  const bool ratio_moved = std::abs(wheel_m - visual_m) > kSlipSigmas * std::hypot(noise_m, known_m);
  const bool ratio_impossible = std::abs(ways->wheel_m - ways->visual_m) > kSlipSigmas * std::hypot(noise_m, raw_m);
  if (ratio_moved || ratio_impossible) isolate_wheel();
}

void Estimator::isolate_wheel() {
  watched(Source::wheel).isolate(stamp_ns_);
  wheel_.good_windows = 0;
  wheel_.window_begin_ns = filter_.stamp_ns();
  wheel_.window_m.reset();
  slip_began_ = true;
}

void Estimator::use(const WheelInput& sample) {
  auto& watch = watched(Source::wheel);
  if (!watch.isolated) doubt_time(watch, pulses_, sample.stamp_ns);
  watch.seen_ns = sample.stamp_ns;
  const double sigma_m = std::hypot(1 / sample.pulses_per_metre / std::sqrt(12.0), 0.001);
  const bool first = !wheel_.first_pulses;
  if (first) wheel_.first_pulses = sample.pulses;
  wheel_.resolution_m = 1 / sample.pulses_per_metre;
  const double wheel_m = static_cast<double>(sample.pulses - *wheel_.first_pulses) / sample.pulses_per_metre;
  slip_watch_.wheel(sample.stamp_ns, wheel_m);
  if (sample.stamp_ns <= wheel_.blocked_until_ns) {
    isolate_wheel();
    slip_began_ = false;
  }
  if (first) {
    if (filter_.unit() == Odometer::none) filter_.choose_unit(Odometer::wheel, *parameters_);
    filter_.restart_wheel(wheel_m, sigma_m);
  } else if (watch.isolated) {
    recover_wheel(sample, wheel_m, sigma_m);
  } else if (offer_motion(Source::wheel, sample.stamp_ns, [&](MotionFilter& filter) {
               return filter.offer_wheel(wheel_m, sigma_m, parameters_->gate_wheel);
             }).used) {
    watch.accept(sample.stamp_ns);
    time_doubt_m_ = 0;
  } else if (++watch.refused >= kRefusalsToIsolate) {
    isolate_wheel();
  }
}

// While the wheel slips its odometer is only compared, window by window; two good windows in which it turned end the
// slip: a wheel that is stuck agrees with every train that stands. Where there is no camera it must be taken as it is.
void Estimator::recover_wheel(const WheelInput& sample, double wheel_m, double sigma_m) {
  const auto begin_window = [&] {
    wheel_.window_begin_ns = sample.stamp_ns;
    wheel_.window_m = wheel_m;
    filter_.restart_wheel(wheel_m, sigma_m);
  };
  if (wheel_.window_begin_ns >= sample.stamp_ns || !wheel_.window_m) begin_window();
  if (core::seconds(sample.stamp_ns - wheel_.window_begin_ns) < kSlipWindowS) return;
  MotionFilter trial = filter_;
  const bool good = trial.offer_wheel(wheel_m, sigma_m, kSlipTestSigmas).used;
  const bool with_camera = watch(Source::camera).seen_ns != 0 && !silent(Source::camera);
  if (with_camera && good && std::abs(wheel_m - *wheel_.window_m) < kRecoveryWayM) return;
  wheel_.good_windows = good ? wheel_.good_windows + 1 : 0;
  begin_window();
  if (wheel_.good_windows >= kGoodWindows) watched(Source::wheel).accept(sample.stamp_ns);
}

std::optional<double> Estimator::Mean::add(int64_t stamp_ns, double value, double period_s) {
  if (count == 0 || core::seconds(stamp_ns - last_ns) > 0.5) *this = {stamp_ns, stamp_ns, 0, 0};
  last_ns = stamp_ns;
  sum += value;
  ++count;
  if (core::seconds(stamp_ns - since_ns) < period_s) return std::nullopt;
  const double mean = sum / count;
  *this = {};
  return mean;
}

void Estimator::use(const ImuInput& sample) {
  auto& imu = watched(Source::imu);
  imu.seen_ns = sample.stamp_ns;
  accel_repeated_.add(sample.accel_x_mps2, sample.stamp_ns);
  const auto accel_mps2 = accel_.add(sample.stamp_ns, sample.accel_x_mps2, parameters_->imu_period_s);
  const auto rate_rps = yaw_.add(sample.stamp_ns, sample.rate_z_rps, parameters_->gyro_period_s);
  if (accel_mps2 || rate_rps) predict_to(sample.stamp_ns);
  if (accel_mps2) use_acceleration(*accel_mps2, sample.stamp_ns);
  if (rate_rps) use_yaw_rate(*rate_rps);
}

void Estimator::use_acceleration(double accel_mps2, int64_t stamp_ns) {
  auto& imu = watched(Source::imu);
  const bool stuck =
      accel_repeated_.count >= kRepeatedSamples && core::seconds(stamp_ns - accel_repeated_.since_ns) >= kRepeatedS;
  if (stuck) {
    imu.isolate(stamp_ns);
    imu.convicted = true;
    imu.agreed = 0;
    return;
  }
  const double grade = path_ ? path_->at(filter_.path_distance_m()).grade : 0.0;
  const double force_mps2 = accel_mps2 - core::kGravityMps2 * grade / std::hypot(1.0, grade);
  const double sigma_mps2 = parameters_->accel_sigma_mps2;
  if (imu.convicted) {
    MotionFilter trial = filter_;
    imu.hear(trial.offer_acceleration(force_mps2, sigma_mps2, parameters_->gate_imu).used, kAgreementsOfImu, stamp_ns);
    return;
  }
  const auto offer = offer_motion(Source::imu, stamp_ns, [&](MotionFilter& filter) {
    return filter.offer_acceleration(force_mps2, sigma_mps2, parameters_->gate_imu);
  });
  if (offer.used) {
    imu.accept(stamp_ns);
  } else if (++imu.refused >= kRefusalsToIsolate) {
    imu.isolate(stamp_ns);
  }
}

// The mean belongs to the middle of its period, which lies v * period / 2 behind.
void Estimator::use_yaw_rate(double rate_rps) {
  const double speed_mps = filter_.speed_mps();
  const double speed_sigma_mps = filter_.sigma(StateIndex::speed);
  if (standstill_) {
    filter_.offer_yaw_rate(rate_rps, 0, 0, parameters_->gyro_sigma_rps, parameters_->gate_gyro);
    return;
  }
  if (!path_ || filter_.path_sigma_m() > kGyroPositionSigmaM || speed_sigma_mps > 1) return;
  const auto point = path_->at(filter_.path_distance_m() - 0.5 * speed_mps * parameters_->gyro_period_s);
  // A tenth of the curvature covers the map's error, which is the same for a whole curve.
  const double sigma_rps =
      parameters_->gyro_sigma_rps + std::abs(point.curvature_per_m) * (0.1 * std::abs(speed_mps) + speed_sigma_mps);
  filter_.offer_yaw_rate(rate_rps, point.curvature_per_m, point.curvature_rate_per_m2, sigma_rps,
                         parameters_->gate_gyro);
}

// Errors of GNSS last: a fix is tested as it is, but says little new beside the one before.
void Estimator::use(const GnssInput& sample) {
  auto& gnss = watched(Source::gnss);
  const double since_s = gnss.seen_ns == 0 ? 1.0 : std::max(core::seconds(sample.stamp_ns - gnss.seen_ns), 0.05);
  gnss.seen_ns = sample.stamp_ns;
  if (sample.fix == 0 || !path_) {
    gnss_agreed_ = 0;
    return;
  }
  const auto place = project(*path_, filter_.path_distance_m(), sample.easting_m, sample.northing_m);
  const double once_m = std::hypot(gnss_sigma_m(sample, *parameters_), parameters_->gnss_map_sigma_m);
  const double sigma_m = once_m * std::sqrt(1 + 2 * parameters_->gnss_error_time_s / since_s);
  const double foot_m = place.distance_m - parameters_->gnss_antenna_ahead_m;
  const bool beside = std::abs(place.lateral_m) > kOffTrackM + 3 * once_m;
  const bool agrees = !beside && filter_.test_position(foot_m, once_m, parameters_->gate_gnss).used;
  if (agrees && filter_.offer_position(foot_m, sigma_m, parameters_->gate_gnss).used) {
    gnss.accept(sample.stamp_ns);
    ++gnss_agreed_;
  } else if (++gnss.refused >= kRefusalsToIsolate) {
    gnss.isolate(sample.stamp_ns);
    gnss_agreed_ = 0;
  }
}

void Estimator::use(const FixInput& fix) {
  if (fix.kind == FixKind::track) {
    if (!path_) return;
    if (fix.new_path) path_ = fix.new_path;
    // What is said of another track is no more than its rest for this one.
    const auto of_m = path_->distance_of(fix.edge, fix.offset_m);
    const double here_m = filter_.path_distance_m();
    track_doubt_.said(of_m ? fix.probability : std::min(fix.probability, 1 - fix.probability), of_m, here_m);
    return;
  }
  auto& watch = watched(fix.kind == FixKind::curvature ? Source::curvature : Source::landmark);
  watch.seen_ns = fix.stamp_ns;
  if (fix.new_path) {
    path_ = fix.new_path;
    filter_.set_origin(0, std::hypot(fix.sigma_m, parameters_->fix_sigma_floor_m));
    track_doubt_.said(fix.probability, std::nullopt, filter_.path_distance_m());
    accept(fix);
    return;
  }
  if (!path_ || fix.probability < parameters_->fix_min_probability) return;
  const auto path_distance_m = path_->distance_of(fix.edge, fix.offset_m);
  if (!path_distance_m) {
    ++off_path_fixes_;
    return;
  }
  // A second fix on the landmark of the first has the same error of the map in it.
  const bool again = fix.landmark != 0 && fix.landmark == reference_ && std::abs(filter_.since_reference_m()) < 50;
  const double sigma_m = std::hypot(fix.sigma_m, parameters_->fix_sigma_floor_m) * (again ? 3.0 : 1.0);
  const auto offer = filter_.offer_position(*path_distance_m, sigma_m, parameters_->gate_fix);
  if (offer.used) {
    corrected_ = false;
    accept(fix);
  } else {
    ++watch.refused;
    refuse(fix, *path_distance_m, offer);
  }
}

void Estimator::accept(const FixInput& fix) {
  watched(fix.kind == FixKind::curvature ? Source::curvature : Source::landmark).accept(fix.stamp_ns);
  fix_verdict_ = FixVerdict::used;
  refused_fix_.reset();
  off_path_fixes_ = 0;
  doubt_m_ = doubt_behind_m_ = doubt_ahead_m_ = time_doubt_m_ = 0;
  // A vague fix helps, but is nothing to measure a distance from.
  if (fix.kind == FixKind::curvature && fix.sigma_m > 2 * filter_.path_sigma_m()) return;
  reference_ = fix.landmark;
  filter_.mark_reference();
}

// One fix alone never moves the train against the filter; a second one elsewhere that says the same does.
void Estimator::refuse(const FixInput& fix, double path_distance_m, const Offer& offer) {
  const double distance_m = filter_.value(StateIndex::distance);
  if (refused_fix_ && std::abs(distance_m - refused_fix_->distance_m) > 10) {
    const double drift_m = 0.04 * std::abs(distance_m - refused_fix_->distance_m);
    const double apart_m = std::abs(offer.residual - refused_fix_->residual_m);
    if (apart_m < 4 * std::hypot(fix.sigma_m, refused_fix_->sigma_m) + drift_m) {
      filter_.loosen_origin(std::abs(offer.residual) + fix.sigma_m);
      filter_.offer_position(path_distance_m, std::hypot(fix.sigma_m, parameters_->fix_sigma_floor_m),
                             parameters_->gate_fix);
      corrected_ = true;
      accept(fix);
      return;
    }
  }
  fix_verdict_ = FixVerdict::refused;
  refused_fix_ = RefusedFix{offer.residual, fix.sigma_m, distance_m};
  const double reach_m = std::abs(offer.residual) + parameters_->interval_factor * fix.sigma_m;
  auto& doubt_m = offer.residual < 0 ? doubt_behind_m_ : doubt_ahead_m_;
  doubt_m = std::max(doubt_m, reach_m);
}

void Estimator::watch_standstill() {
  const double distance_m = filter_.value(StateIndex::distance);
  if (std::abs(distance_m - rest_distance_m_) > kRestM || filter_.sigma(StateIndex::speed) > kRestSpeedSigmaMps) {
    rest_distance_m_ = distance_m;
    rest_since_ns_ = stamp_ns_;
  }
  standstill_ = core::seconds(stamp_ns_ - rest_since_ns_) >= kRestS;
}

}  // namespace railfix::fusion
