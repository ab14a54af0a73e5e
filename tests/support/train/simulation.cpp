#include "support/train/simulation.hpp"

#include <algorithm>
#include <cmath>

#include "core/units.hpp"

namespace railfix::train {
namespace {

using fusion::GnssInput;
using fusion::ImuInput;
using fusion::OdometryInput;
using fusion::WheelInput;

constexpr double kPulseS = 0.05;
constexpr double kInertialS = 0.02;
constexpr double kPulsesPerMetre = 90;
constexpr double kKeyFrameM = 0.15;
constexpr double kYawNoiseRad = 3e-4;  // of a step, as the camera measures it
constexpr double kShapeM = 500;        // a curve and the next err by themselves
// Of a scale, between trips of one train: the light and the track for a camera, load and temperature for a wheel.
constexpr double kCameraTripChange = 2e-4;
constexpr double kWheelTripChange = 5e-5;

constexpr double kFirstSwitchBehindM = 100;  // the train begins on the way's first edge

Drive drive_on(uint64_t seed, const SimulationPlan& plan, double most_m) {
  auto random = stream(seed, 2);
  return Drive(random, plan.duration_s, plan.max_speed_mps, most_m, plan.style);
}

RandomLine line_of(uint64_t seed, const SimulationPlan& plan) {
  auto random = stream(seed, 1);
  const double way_m = (plan.max_speed_mps + 3) * plan.duration_s + plan.start_wrong_m;
  auto line = random_line(random, TrainSimulation::kStartOffsetM + way_m + 1000, plan.switch_spacing_m,
                          TrainSimulation::kStartOffsetM + kFirstSwitchBehindM);
  auto things = stream(seed, 19);
  if (plan.sightings) furnish(line, things);
  return line;
}

}  // namespace

SimulationPlan campaign_plan() {
  SimulationPlan plan;
  plan.duration_s = 240;
  plan.max_speed_mps = 150 / 3.6;
  plan.visual_scale_error = 0.004;
  plan.landmark_spacing_m = 600;
  plan.landmark_spread = 0.7;
  plan.false_fix_share = 0.005;
  plan.fix_probability = 0.995;
  plan.track_fixes = plan.shape = true;
  plan.switch_spacing_m = 1500;
  return plan;
}

void leave_to_map_matcher(SimulationPlan& plan) {
  plan.whole_matcher = plan.sightings = true;
  plan.track_fixes = false;
  plan.landmark_spacing_m = 0;
}

uint64_t seed_of_run(uint64_t campaign_seed, uint64_t number) {
  return campaign_seed * 1'000'000 + number;
}

core::Random draws_of_run(uint64_t seed) {
  return core::Random(seed * 77 + 5);
}

void draw_fault(SimulationPlan& plan, core::Random& draws, Sensor sensor, FaultKind kind, bool slip_always) {
  plan.fault = random_fault(draws, sensor, kind, plan.duration_s);
  plan.slip = plan.slip && (slip_always || sensor == Sensor::wheel || sensor == Sensor::gnss || sensor == Sensor::fix ||
                            sensor == Sensor::clock);
}

core::Random stream(uint64_t seed, uint64_t number) {
  core::Random mixed(seed * 1'000'003 + number);
  return core::Random(mixed.next());
}

TrainSimulation::TrainSimulation(const SimulationPlan& plan, uint64_t seed)
    : TrainSimulation(plan, seed, line_of(seed, plan)) {}

TrainSimulation::TrainSimulation(const SimulationPlan& plan, uint64_t seed, const RandomLine& line)
    : TrainSimulation(plan, seed, line.map, {1, kStartOffsetM, track::Direction::forward}, line.way) {
  if (plan.sightings) make_sightings(line.things);
}

TrainSimulation::TrainSimulation(const SimulationPlan& plan, uint64_t seed, std::shared_ptr<const track::Map> on,
                                 const track::EdgePosition& start)
    : TrainSimulation(plan, seed, std::move(on), start, {}) {}

TrainSimulation::TrainSimulation(const SimulationPlan& plan, uint64_t seed, std::shared_ptr<const track::Map> on,
                                 const track::EdgePosition& start, const std::vector<uint32_t>& via)
    : map(std::move(on)),
      plan_(plan),
      seed_(seed),
      start_(start),
      path_(std::make_shared<const track::Path>(
          core::value_or_throw(track::Path::follow(map, start, 300000, 1000, via)))),
      drive_(drive_on(seed, plan, path_->end_m() - 10)) {
  if (plan_.track_fixes || plan_.whole_matcher) find_points();
  measure();
}

void TrainSimulation::measure() {
  auto random = stream(seed_, 3);
  start_error_m = plan_.start_sigma_m * random.normal();
  if (plan_.start_wrong_m > 0) start_error_m += plan_.start_wrong_m * random.uniform(0.2, 1);
  if (plan_.shape) lay_track();
  if (plan_.camera) make_steps();
  if (plan_.wheel) make_pulses();
  if (plan_.imu) make_inertial();
  if (plan_.gnss) make_gnss();
  if (plan_.track_fixes) {
    make_declarations();
    make_track_fixes();
  }
  if (!plan_.map_landmarks.empty()) {
    make_fixes_of_map();
  } else if (plan_.landmark_spacing_m > 0) {
    make_fixes();
  }
  if (!plan_.start_told && !plan_.whole_matcher) make_network_fixes();
  std::stable_sort(arrivals.begin(), arrivals.end(),
                   [](const Arrival& a, const Arrival& b) { return a.arrival_s < b.arrival_s; });
}

std::optional<track::EdgePosition> TrainSimulation::start() const {
  if (!plan_.start_told) return std::nullopt;
  if (plan_.start_wrong_m > 0) return path_->position_at(start_error_m);
  auto place = start_;
  place.offset_m += place.direction == track::Direction::reverse ? -start_error_m : start_error_m;
  return place;
}

int64_t TrainSimulation::stamp_ns(double t_s) const {
  double shift_s = 0;
  const auto& fault = plan_.fault;
  if (fault.is(Sensor::clock, FaultKind::clock_step) && t_s >= fault.begin_s) shift_s = fault.size;
  if (fault.is(Sensor::clock, FaultKind::drift)) {
    shift_s = fault.size * std::clamp(t_s - fault.begin_s, 0.0, fault.end_s - fault.begin_s);
  }
  return kBeginNs + core::to_ns(t_s + shift_s);
}

Motion TrainSimulation::truth_at(int64_t stamp_ns, double arrival_s) const {
  double t_s = core::seconds(stamp_ns - kBeginNs);
  const auto& fault = plan_.fault;
  if (fault.is(Sensor::clock, FaultKind::clock_step) && arrival_s >= fault.begin_s) {
    const double set_s = t_s - fault.size;
    if (fault.size > 0 ? set_s >= fault.begin_s : set_s <= arrival_s + 1e-3) {
      t_s = set_s;
    } else if (fault.size > 0) {
      t_s = std::min(t_s, fault.begin_s);
    }
  }
  if (fault.is(Sensor::clock, FaultKind::drift) && t_s > fault.begin_s) {
    const double run_s = (t_s - fault.begin_s) / (1 + fault.size);
    const double full_s = fault.end_s - fault.begin_s;
    t_s = run_s < full_s ? fault.begin_s + run_s : t_s - fault.size * full_s;
  }
  return drive_.at(t_s);
}

Motion TrainSimulation::pictured_at(int64_t stamp_ns, double arrival_s) const {
  const bool jumps = plan_.fault.is(Sensor::camera, FaultKind::stamp_jump);
  const double taken_s = arrival_s - (jumps ? std::max(0.0, plan_.fault.size) : 0);
  return truth_at(stamp_ns - core::to_ns(lag_of(Sensor::camera, taken_s)), arrival_s);
}

std::optional<double> TrainSimulation::error_m(const track::EdgePosition& place, const Motion& truth) const {
  // A way may lead over one edge twice, as around a balloon loop: the pass that the train is on counts.
  const auto distance_m = path_->distance_of(place, truth.distance_m);
  if (distance_m) return *distance_m - truth.distance_m;
  std::optional<double> nearest_m;
  for (const auto& [at_m, other] : points_) {
    if (other.edge->id != place.edge) continue;
    const double behind_m = other.forward ? place.offset_m : other.length_m() - place.offset_m;
    const double one_m = at_m + behind_m - truth.distance_m;
    if (!nearest_m || std::abs(one_m) < std::abs(*nearest_m)) nearest_m = one_m;
  }
  return nearest_m;
}

bool TrainSimulation::on_way(const track::EdgePosition& place) const {
  return path_->distance_of(place.edge, place.offset_m).has_value();
}

void TrainSimulation::lay_track() {
  auto random = stream(seed_, 16);
  for (double m = 0; m < way_m() + 2 * kShapeM; m += kShapeM) {
    shape_errors_m_.push_back(plan_.map_shape_m * random.normal());
  }
}

double TrainSimulation::curvature_at(double distance_m, double t_s) const {
  double error_m = faulty(Sensor::shape, FaultKind::bias, t_s) ? plan_.fault.size : 0;
  if (!shape_errors_m_.empty()) {
    const double cell = std::clamp(distance_m / kShapeM, 0.0, static_cast<double>(shape_errors_m_.size() - 2));
    const auto i = static_cast<size_t>(cell);
    error_m += std::lerp(shape_errors_m_[i], shape_errors_m_[i + 1], cell - static_cast<double>(i));
  }
  return path_->curvature_at(distance_m + error_m);
}

bool TrainSimulation::sees(double t_s) const {
  return within(blind_, t_s) == nullptr && !faulty(Sensor::camera, FaultKind::blind, t_s) &&
         !faulty(Sensor::camera, FaultKind::dropout, t_s) && !faulty(Sensor::camera, FaultKind::stuck, t_s);
}

bool TrainSimulation::faulty(Sensor sensor, FaultKind kind, double t_s) const {
  return plan_.fault.is(sensor, kind) && plan_.fault.active(t_s);
}

// Bias or drift of one sensor at this time, in its own unit. What a drift has come to stays until the end.
double TrainSimulation::offset_of(Sensor sensor, double t_s) const {
  if (faulty(sensor, FaultKind::bias, t_s)) return plan_.fault.size;
  if (plan_.fault.is(sensor, FaultKind::drift)) return plan_.fault.size * plan_.fault.progress(t_s);
  return 0;
}

void TrainSimulation::add(Sensor sensor, double t_s, fusion::Event event) {
  if (faulty(sensor, FaultKind::dropout, t_s)) return;
  const bool late = faulty(sensor, FaultKind::delay, t_s);
  const double lag_s = lag_of(sensor, t_s);
  std::visit([lag_s](auto& one) { one.stamp_ns += core::to_ns(lag_s); }, event);
  if (auto* step = std::get_if<OdometryInput>(&event)) {
    const double reference_s = core::seconds(step->reference_stamp_ns - kBeginNs);
    step->reference_stamp_ns += core::to_ns(lag_of(sensor, reference_s));
  }
  arrivals.push_back({t_s + std::max(0.0, lag_s) + (late ? plan_.fault.size : 0.0), std::move(event)});
}

// Landmarks and tracks are seen in the camera's pictures.
double TrainSimulation::lag_of(Sensor sensor, double t_s) const {
  const Sensor of = sensor == Sensor::fix ? Sensor::camera : sensor;
  if (plan_.fault.is(of, FaultKind::stamp_jump)) return t_s >= plan_.fault.begin_s ? plan_.fault.size : 0;
  return plan_.fault.is(of, FaultKind::lag) && of != Sensor::gnss ? plan_.fault.size : 0;
}

std::vector<TrainSimulation::Spell> TrainSimulation::spells(core::Random& random, double every_s, double shortest_s,
                                                            double longest_s, double size) const {
  std::vector<Spell> result;
  for (double t = random.uniform(0, every_s); t < duration_s(); t += every_s * random.uniform(0.5, 1.5)) {
    result.push_back({t, t + random.uniform(shortest_s, longest_s), random.uniform(-size, size)});
  }
  return result;
}

const TrainSimulation::Spell* TrainSimulation::within(const std::vector<Spell>& all, double t_s) {
  const auto it =
      std::find_if(all.begin(), all.end(), [&](const Spell& s) { return t_s >= s.begin_s && t_s < s.end_s; });
  return it == all.end() ? nullptr : &*it;
}

double TrainSimulation::scale_error_of(double usual, double trip_change, core::Random& random, uint64_t number) const {
  const double here = random.normal();
  if (!plan_.train) return usual * here;
  return usual * stream(*plan_.train, number).normal() + trip_change * here;
}

// A key frame is kept until 0.15 m are run; steps refer to it. Scale wanders a little around its error.
void TrainSimulation::make_steps() {
  auto random = stream(seed_, 10);
  if (plan_.blind_spells) blind_ = spells(random, 60, 5, 15, 0);
  camera_scale_error = scale_error_of(plan_.visual_scale_error, kCameraTripChange, random, 10);
  const double scale = 1 + camera_scale_error;
  const double phase = random.uniform(0, 6);
  auto yaw_random = stream(seed_, 21);
  double reference_s = 0;
  double seen_m = 0;  // way as the camera measures it
  double reference_m = 0;
  double heading_rad = 0;
  double reference_rad = 0;
  for (int i = 1; i * kPictureS <= duration_s(); ++i) {
    const double t = i * kPictureS;
    const double true_m = drive_.at(t).distance_m;
    const double wander = 1 + plan_.visual_wander * std::sin(phase + true_m / 3000);
    seen_m += (true_m - drive_.at(t - kPictureS).distance_m) / (scale * wander) * (1 + offset_of(Sensor::camera, t));
    heading_rad += (true_m - drive_.at(t - kPictureS).distance_m) * curvature_at(true_m, t);
    const bool lost = random.uniform() < 0.01;
    const double times = faulty(Sensor::camera, FaultKind::noise, t) ? plan_.fault.size : 1;
    const double share = faulty(Sensor::camera, FaultKind::outliers, t) ? 0.3 : plan_.outlier_share;
    OdometryInput step{stamp_ns(t), stamp_ns(reference_s), seen_m - reference_m, plan_.step_noise_m, true};
    step.step_m += times * plan_.step_noise_m * random.normal();
    step.yaw_rad = heading_rad - reference_rad + kYawNoiseRad * yaw_random.normal();
    step.yaw_sigma_rad = kYawNoiseRad;
    const double sleeper = random.uniform() < 0.5 ? 0.6 : -0.6;
    if (random.uniform() < share) step.step_m += sleeper;
    if (faulty(Sensor::camera, FaultKind::stuck, t)) step.step_m = 0;
    const bool dark = within(blind_, t) != nullptr || faulty(Sensor::camera, FaultKind::blind, t);
    if (dark) step = {step.stamp_ns, step.reference_stamp_ns, 0, 0, false};
    if (lost) continue;
    add(Sensor::camera, t, step);
    if (dark || std::abs(seen_m - reference_m) > kKeyFrameM) {
      reference_s = t;
      reference_m = seen_m;
      reference_rad = heading_rad;
    }
  }
}

void TrainSimulation::make_pulses() {
  auto random = stream(seed_, 11);
  const auto slips = plan_.slip ? spells(random, 60, 2, 8, 0.3) : std::vector<Spell>{};
  wheel_scale_error = scale_error_of(plan_.wheel_scale_error, kWheelTripChange, random, 11);
  const double scale = 1 + wheel_scale_error;
  double wheel_m = random.uniform();
  for (int i = 0; i * kPulseS <= duration_s(); ++i) {
    const double t = i * kPulseS;
    const double way_m = i == 0 ? 0 : drive_.at(t).distance_m - drive_.at(t - kPulseS).distance_m;
    const auto* slip = within(slips, t);
    const bool stuck = faulty(Sensor::wheel, FaultKind::stuck, t);
    if (!stuck) wheel_m += way_m / scale * (slip ? 1 + slip->size : 1) * (1 + offset_of(Sensor::wheel, t));
    const bool jump = random.uniform() < 0.05;
    const double jump_m = random.uniform(-5, 5);
    if (jump && faulty(Sensor::wheel, FaultKind::outliers, t)) wheel_m += jump_m;
    const double jitter = random.normal();
    const double noise_m = faulty(Sensor::wheel, FaultKind::noise, t) ? plan_.fault.size * 0.01 * jitter : 0;
    add(Sensor::wheel, t,
        WheelInput{stamp_ns(t), static_cast<int64_t>(std::floor((wheel_m + noise_m) * kPulsesPerMetre)),
                   kPulsesPerMetre});
  }
}

// Both are in one sensor: they come late or not at all together.
void TrainSimulation::make_inertial() {
  auto random = stream(seed_, 12);
  const double bias = 0.08 * random.normal();
  const double gyro_bias = 0.002 * random.normal();
  const auto& fault = plan_.fault;
  std::optional<double> stuck_accel;
  std::optional<double> stuck_rate;
  for (int i = 1; i * kInertialS <= duration_s(); ++i) {
    const double t = i * kInertialS;
    const auto now = drive_.at(t);
    const double accel = (drive_.at(t + 0.01).speed_mps - drive_.at(t - 0.01).speed_mps) / 0.02;
    const auto point = path_->at(now.distance_m);
    const double accel_times = faulty(Sensor::accelerometer, FaultKind::noise, t) ? fault.size : 1;
    const double rate_times = faulty(Sensor::gyro, FaultKind::noise, t) ? fault.size : 1;
    ImuInput sample{stamp_ns(t), accel + core::kGravityMps2 * point.grade + bias + accel_times * 0.2 * random.normal(),
                    now.speed_mps * curvature_at(now.distance_m, t) + gyro_bias + rate_times * 0.01 * random.normal()};
    sample.accel_x_mps2 += offset_of(Sensor::accelerometer, t);
    sample.rate_z_rps += offset_of(Sensor::gyro, t);
    const bool wild = random.uniform() < 0.1;
    if (wild && faulty(Sensor::accelerometer, FaultKind::outliers, t)) sample.accel_x_mps2 += 20;
    if (wild && faulty(Sensor::gyro, FaultKind::outliers, t)) sample.rate_z_rps += 2;
    if (faulty(Sensor::accelerometer, FaultKind::stuck, t)) {
      sample.accel_x_mps2 = *(stuck_accel = stuck_accel.value_or(sample.accel_x_mps2));
    }
    if (faulty(Sensor::gyro, FaultKind::stuck, t)) {
      sample.rate_z_rps = *(stuck_rate = stuck_rate.value_or(sample.rate_z_rps));
    }
    add(fault.sensor == Sensor::gyro ? Sensor::gyro : Sensor::accelerometer, t, sample);
  }
}

void TrainSimulation::make_gnss() {
  auto random = stream(seed_, 13);
  const auto outages = spells(random, 60, 10, 40, 0);
  const auto& fault = plan_.fault;
  const double towards = random.uniform(0, 6.28);
  double east = 2 * random.normal();
  double north = 2 * random.normal();
  std::optional<GnssInput> stuck;
  for (int i = 0; i <= duration_s(); ++i) {
    east = 0.98 * east + 0.4 * random.normal();
    north = 0.98 * north + 0.4 * random.normal();
    const double lag_s = faulty(Sensor::gnss, FaultKind::lag, i) ? fault.size : 0;
    const auto pose = path_->at(drive_.at(i - lag_s).distance_m).pose;
    const double noisy_east = random.normal();
    const double noisy_north = random.normal();
    const double times = faulty(Sensor::gnss, FaultKind::noise, i) ? 3 * fault.size : 0;
    const double share = faulty(Sensor::gnss, FaultKind::outliers, i) ? 0.3 : 0.02;
    const double wild = random.uniform() < share ? 80 : 0;
    const double wrong_m = offset_of(Sensor::gnss, i);
    GnssInput sample{stamp_ns(i), pose.easting_m + east + wild + times * noisy_east + wrong_m * std::cos(towards),
                     pose.northing_m + north + times * noisy_north + wrong_m * std::sin(towards), 1.0,
                     within(outages, i) != nullptr ? 0 : 1};
    if (faulty(Sensor::gnss, FaultKind::stuck, i)) {
      if (!stuck) stuck = sample;
      sample.easting_m = stuck->easting_m;
      sample.northing_m = stuck->northing_m;
    }
    add(Sensor::gnss, i, sample);
  }
}

}  // namespace railfix::train
