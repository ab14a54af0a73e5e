#include "fusion/motion_filter.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>

#include "core/time.hpp"

namespace railfix::fusion {

using estimation::StateMatrix;
using estimation::StateVector;

namespace {

constexpr int kCore = static_cast<int>(StateIndex::count);
constexpr int kRecentClones = 2;  // pictures before this one that the next step may still refer to
constexpr double kUnknownPositionM = 1e5;
constexpr double kUnknownSpeedMps = 60.0;
constexpr double kLongestStepS = 0.1;
constexpr double kGyroBiasWalk2 = 1e-10;  // (rad/s)^2 a second: it changes by 0.6 mrad/s in an hour

double squared(double value) {
  return value * value;
}

}  // namespace

MotionFilter::MotionFilter(const FusionParameters& parameters, const OdometerScales& scales, int64_t stamp_ns,
                           bool origin_known)
    : stamp_ns_(stamp_ns), known_before_(scales), x_(StateVector::Zero(kCore)) {
  StateVector sigma(kCore);
  sigma << 0.0, 0.0, origin_known ? parameters.start_sigma_m : kUnknownPositionM, kUnknownSpeedMps,
      parameters.acceleration_sigma_mps2, parameters.accel_bias_sigma_mps2, scales.camera_sigma, scales.wheel_sigma,
      kUnknownPositionM, kGyroBiasSigmaRps, parameters.shape_error_sigma_m, 1.0;
  ud_ = estimation::UdFilter(StateVector(sigma.cwiseAbs2()));
}

void MotionFilter::choose_unit(Odometer odometer) {
  unit_ = odometer;
  const auto& before = known_before_;
  const bool camera = odometer == Odometer::camera;
  const int unit = index(StateIndex::unit_scale);
  const int other = index(StateIndex::other_scale);
  const double unit_sigma = camera ? before.camera_sigma : before.wheel_sigma;
  const double other_sigma = camera ? before.wheel_sigma : before.camera_sigma;
  x_(unit) = camera ? before.camera : before.wheel;
  x_(other) = (1 + (camera ? before.wheel : before.camera)) / (1 + x_(unit)) - 1;
  ud_.reset(unit, squared(unit_sigma));
  ud_.reset(other, squared(other_sigma) * (1 - squared(before.correlation)));
  // Against the unit the other one is its own error less the unit's, of which it has a share in common.
  const auto n = x_.size();
  StateMatrix phi = StateMatrix::Identity(n, n);
  phi(other, unit) = before.correlation * other_sigma / unit_sigma - 1;
  ud_.propagate(phi, StateMatrix::Zero(n, 1), StateVector::Zero(1));
}

void MotionFilter::predict_to(int64_t stamp_ns, const FusionParameters& parameters) {
  const double dt_s = core::seconds(stamp_ns - stamp_ns_);
  if (dt_s > 0) {
    const int steps = static_cast<int>(std::clamp(std::ceil(dt_s / kLongestStepS), 1.0, 100.0));
    for (int k = 0; k < steps; ++k) step(dt_s / steps, parameters);
  }
  stamp_ns_ = std::max(stamp_ns, stamp_ns_);
}

MotionFilter::Prediction MotionFilter::prediction(double dt_s, const FusionParameters& p) const {
  Prediction m;
  const double tau = p.acceleration_time_s;
  m.dt_s = dt_s;
  m.acceleration_keep = std::exp(-dt_s / tau);
  m.speed_per_accel = tau * (1 - m.acceleration_keep);
  m.way_per_accel = tau * (dt_s - m.speed_per_accel);
  m.way_m = value(StateIndex::speed) * dt_s + value(StateIndex::acceleration) * m.way_per_accel;
  m.per_camera = 1 / to_unit(Odometer::camera);
  m.per_wheel = 1 / to_unit(Odometer::wheel);
  // A scale walks, but stays within its sigma.
  const auto scale_keep = [&](double walk, double sigma) {
    return std::exp(-0.5 * squared(walk / sigma) * std::abs(m.way_m));
  };
  m.unit_keep = scale_keep(p.visual_scale_walk, p.visual_scale_sigma);
  m.other_keep = scale_keep(p.wheel_scale_walk, p.wheel_scale_sigma);
  m.unit_noise = squared(p.visual_scale_sigma) * (1 - squared(m.unit_keep));
  m.other_noise = squared(p.wheel_scale_sigma) * (1 - squared(m.other_keep));
  if (unit_ == Odometer::wheel) {
    std::swap(m.unit_keep, m.other_keep);
    std::swap(m.unit_noise, m.other_noise);
  }
  m.shape_keep = std::exp(-std::abs(m.way_m) / p.shape_error_length_m);
  m.gnss_keep = p.gnss_error_time_s > 0 ? std::exp(-dt_s / p.gnss_error_time_s) : 0.0;
  return m;
}

StateMatrix MotionFilter::transition(const Prediction& m) const {
  const auto n = x_.size();
  const int camera = index(StateIndex::camera_odometer);
  const int wheel = index(StateIndex::wheel_odometer);
  const int distance = index(StateIndex::distance);
  const int speed = index(StateIndex::speed);
  const int acceleration = index(StateIndex::acceleration);
  const int unit_scale = index(StateIndex::unit_scale);
  const int other_scale = index(StateIndex::other_scale);
  const double k = 1 + x_(unit_scale);
  StateMatrix phi = StateMatrix::Identity(n, n);
  phi(unit_scale, unit_scale) = m.unit_keep;
  phi(other_scale, other_scale) = m.other_keep;
  phi(camera, speed) = m.per_camera * m.dt_s;
  phi(camera, acceleration) = m.per_camera * m.way_per_accel;
  phi(distance, speed) = k * m.dt_s;
  phi(distance, acceleration) = k * m.way_per_accel;
  phi(distance, unit_scale) = m.way_m;
  phi(speed, acceleration) = m.speed_per_accel;
  phi(acceleration, acceleration) = m.acceleration_keep;
  phi(wheel, speed) = m.per_wheel * m.dt_s;
  phi(wheel, acceleration) = m.per_wheel * m.way_per_accel;
  if (unit_ == Odometer::wheel) {
    phi(camera, other_scale) = -m.way_m * squared(m.per_camera);
  } else {
    phi(wheel, other_scale) = -m.way_m * squared(m.per_wheel);
  }
  phi(index(StateIndex::shape_error), index(StateIndex::shape_error)) = m.shape_keep;
  phi(index(StateIndex::gnss_error), index(StateIndex::gnss_error)) = m.gnss_keep;
  return phi;
}

void MotionFilter::step(double dt_s, const FusionParameters& p) {
  const Prediction m = prediction(dt_s, p);
  const double way_m = std::abs(m.way_m);
  const std::pair<StateIndex, double> noises[] = {
      {StateIndex::acceleration, squared(p.acceleration_sigma_mps2) * (1 - squared(m.acceleration_keep))},
      {StateIndex::accel_bias, squared(p.accel_bias_walk) * dt_s},
      {StateIndex::unit_scale, m.unit_noise},
      {StateIndex::other_scale, m.other_noise},
      {StateIndex::camera_odometer, squared(p.visual_creep) * way_m},
      {StateIndex::wheel_odometer, squared(p.wheel_creep) * way_m},
      {StateIndex::gyro_bias, kGyroBiasWalk2 * dt_s},
      {StateIndex::shape_error, squared(p.shape_error_sigma_m) * (1 - squared(m.shape_keep))},
      {StateIndex::gnss_error, 1 - squared(m.gnss_keep)}};
  constexpr int kNoises = static_cast<int>(std::size(noises));
  StateMatrix g = StateMatrix::Zero(x_.size(), kNoises);
  StateVector q(kNoises);
  for (int i = 0; i < kNoises; ++i) {
    g(index(noises[i].first), i) = 1;
    q(i) = noises[i].second;
  }
  ud_.propagate(transition(m), g, q);
  move(m);
}

void MotionFilter::move(const Prediction& m) {
  x_(index(StateIndex::camera_odometer)) += m.way_m * m.per_camera;
  x_(index(StateIndex::distance)) += (1 + x_(index(StateIndex::unit_scale))) * m.way_m;
  x_(index(StateIndex::wheel_odometer)) += m.way_m * m.per_wheel;
  x_(index(StateIndex::speed)) += x_(index(StateIndex::acceleration)) * m.speed_per_accel;
  x_(index(StateIndex::acceleration)) *= m.acceleration_keep;
  x_(index(StateIndex::unit_scale)) *= m.unit_keep;
  x_(index(StateIndex::other_scale)) *= m.other_keep;
  x_(index(StateIndex::shape_error)) *= m.shape_keep;
  x_(index(StateIndex::gnss_error)) *= m.gnss_keep;
}

void MotionFilter::rebase_clock(int64_t stamp_ns) {
  forget_clones();
  stamp_ns_ = stamp_ns;
}

void MotionFilter::forget_clones() {
  while (!clones_.empty()) remove_clone(0);
}

void MotionFilter::clone_now(int64_t keep_ns) {
  int newer = 0;
  for (int i = 0; i < static_cast<int>(clones_.size());) {
    if (clones_[i] == keep_ns || newer++ < kRecentClones) {
      ++i;
    } else {
      remove_clone(i);
    }
  }
  if (has_clone(stamp_ns_)) return;
  const int odometer = index(StateIndex::camera_odometer);
  StateVector x(x_.size() + 1);
  x << x_(odometer), x_;
  ud_.clone_to_front(odometer);
  x_ = x;
  clones_.insert(clones_.begin(), stamp_ns_);
}

Offer MotionFilter::offer_step(int64_t reference_stamp_ns, double step_m, double sigma_m, double gate) {
  const auto clone = clone_index(reference_stamp_ns);
  if (!clone) return {};
  StateVector h = zero_row();
  h(index(StateIndex::camera_odometer)) = 1;
  h(*clone) = -1;
  return offer(h, step_m - (value(StateIndex::camera_odometer) - x_(*clone)), sigma_m, gate);
}

Offer MotionFilter::offer_speed(double speed_mps, double sigma_mps, double gate) {
  const double per_camera = 1 / to_unit(Odometer::camera);
  StateVector h = zero_row();
  h(index(StateIndex::speed)) = per_camera;
  if (unit_ == Odometer::wheel) {
    h(index(StateIndex::other_scale)) = -value(StateIndex::speed) * squared(per_camera);
  }
  return offer(h, speed_mps - value(StateIndex::speed) * per_camera, sigma_mps, gate);
}

Offer MotionFilter::offer_wheel(double wheel_m, double sigma_m, double gate) {
  StateVector h = zero_row();
  h(index(StateIndex::wheel_odometer)) = 1;
  return offer(h, wheel_m - value(StateIndex::wheel_odometer), sigma_m, gate);
}

Offer MotionFilter::offer_acceleration(double accel_mps2, double sigma_mps2, double gate) {
  StateVector h = zero_row();
  h(index(StateIndex::acceleration)) = 1;
  h(index(StateIndex::accel_bias)) = 1;
  return offer(h, accel_mps2 - value(StateIndex::acceleration) - value(StateIndex::accel_bias), sigma_mps2, gate);
}

Offer MotionFilter::offer_position(const MeasuredPlace& place, double gate) {
  StateVector h = zero_row();
  h(index(StateIndex::distance)) = 1;
  h(index(StateIndex::origin)) = 1;
  double expected_m = path_distance_m();
  if (place.lasting) {
    h(index(*place.lasting)) = place.per_lasting;
    expected_m += place.per_lasting * value(*place.lasting);
  }
  return offer(h, place.path_distance_m - expected_m, place.sigma_m, gate);
}

Offer MotionFilter::test_position(double path_distance_m, double sigma_m, double gate) const {
  const double residual = path_distance_m - this->path_distance_m();
  const double variance = squared(path_sigma_m()) + squared(sigma_m);
  const double nis = squared(residual) / variance;
  return {nis <= squared(gate), residual, nis};
}

Offer MotionFilter::offer_yaw_rate(double rate_rps, double curvature_per_m, double curvature_rate_per_m2,
                                   double sigma_rps, double gate) {
  const double speed_mps = this->speed_mps();
  StateVector h = zero_row();
  h(index(StateIndex::distance)) = speed_mps * curvature_rate_per_m2;
  h(index(StateIndex::origin)) = speed_mps * curvature_rate_per_m2;
  h(index(StateIndex::shape_error)) = speed_mps * curvature_rate_per_m2;
  h(index(StateIndex::gyro_bias)) = 1;
  const double curvature_there_per_m = curvature_per_m + curvature_rate_per_m2 * value(StateIndex::shape_error);
  return offer(h, rate_rps - speed_mps * curvature_there_per_m - value(StateIndex::gyro_bias), sigma_rps, gate);
}

void MotionFilter::restart_wheel(double wheel_m, double sigma_m) {
  x_(index(StateIndex::wheel_odometer)) = wheel_m;
  ud_.reset(index(StateIndex::wheel_odometer), squared(sigma_m));
}

void MotionFilter::doubt_wheel(double sigma_m) {
  ud_.inflate(index(StateIndex::wheel_odometer), squared(sigma_m));
}

void MotionFilter::doubt_accel_bias(double sigma_mps2) {
  ud_.inflate(index(StateIndex::accel_bias), squared(sigma_mps2));
}

void MotionFilter::loosen_origin(double sigma_m) {
  ud_.inflate(index(StateIndex::origin), squared(sigma_m));
}

void MotionFilter::loosen_scale(const FusionParameters& parameters) {
  const bool camera = unit_ != Odometer::wheel;
  ud_.inflate(index(StateIndex::unit_scale),
              squared(camera ? parameters.visual_scale_sigma : parameters.wheel_scale_sigma));
}

// The scale of the one odometer against the other is no matter of references.
void MotionFilter::forget_references() {
  const bool camera = unit_ != Odometer::wheel;
  const int unit = index(StateIndex::unit_scale);
  const double before = camera ? known_before_.camera : known_before_.wheel;
  const double sigma = camera ? known_before_.camera_sigma : known_before_.wheel_sigma;
  const double false_share = sigma + std::abs(x_(unit) - before);
  ud_.inflate(index(StateIndex::distance), squared(false_share * value(StateIndex::distance)));
  x_(unit) = before;
  ud_.reset(unit, squared(sigma));
}

void MotionFilter::set_origin(double path_distance_m, double sigma_m) {
  x_(index(StateIndex::origin)) = path_distance_m - value(StateIndex::distance);
  ud_.reset(index(StateIndex::origin), squared(sigma_m));
  // How far the train had run before does not make the place any vaguer.
  ud_.reset(index(StateIndex::distance), 0);
}

void MotionFilter::doubt_time(double sigma_s) {
  const auto n = x_.size();
  const double speed = value(StateIndex::speed);
  StateMatrix per_s = StateMatrix::Zero(n, 1);
  per_s(index(StateIndex::camera_odometer), 0) = speed / to_unit(Odometer::camera);
  per_s(index(StateIndex::distance), 0) = speed * unit_scale();
  per_s(index(StateIndex::wheel_odometer), 0) = speed / to_unit(Odometer::wheel);
  per_s(index(StateIndex::speed), 0) = value(StateIndex::acceleration);
  ud_.propagate(StateMatrix::Identity(n, n), per_s, StateVector::Constant(1, squared(sigma_s)));
}

void MotionFilter::loosen_speed(double sigma_mps) {
  forget_clones();
  ud_.reset(index(StateIndex::speed), squared(sigma_mps));
}

void MotionFilter::doubt_first_speed(Odometer measured, double since_s) {
  const auto n = x_.size();
  StateMatrix g = StateMatrix::Zero(n, 1);
  const bool camera = measured == Odometer::camera;
  const auto other = camera ? StateIndex::wheel_odometer : StateIndex::camera_odometer;
  g(index(other), 0) = since_s / to_unit(camera ? Odometer::wheel : Odometer::camera);
  if (measured != unit_) {
    g(index(StateIndex::speed), 0) = 1;
    g(index(StateIndex::distance), 0) = unit_scale() * since_s;
  }
  const double scale_mps = sigma(StateIndex::other_scale) * value(StateIndex::speed);
  ud_.propagate(StateMatrix::Identity(n, n), g, StateVector::Constant(1, squared(scale_mps)));
}

// One change at the begin of that time, and one now for all the changes between.
void MotionFilter::doubt_acceleration(double since_s, double sigma_mps2) {
  const auto n = x_.size();
  const double way_m = 0.5 * squared(since_s);
  StateMatrix g = StateMatrix::Zero(n, 2);
  g(index(StateIndex::camera_odometer), 0) = way_m / to_unit(Odometer::camera);
  g(index(StateIndex::distance), 0) = unit_scale() * way_m;
  g(index(StateIndex::wheel_odometer), 0) = way_m / to_unit(Odometer::wheel);
  g(index(StateIndex::speed), 0) = since_s;
  g(index(StateIndex::acceleration), 0) = 1;
  g(index(StateIndex::acceleration), 1) = 1;
  ud_.propagate(StateMatrix::Identity(n, n), g, StateVector::Constant(2, squared(sigma_mps2)));
}

void MotionFilter::place_like(const MotionFilter& other) {
  const double distance_sigma_m = other.sigma(StateIndex::distance);
  const double path_sigma_m = other.path_sigma_m();
  x_(index(StateIndex::distance)) = other.value(StateIndex::distance);
  x_(index(StateIndex::origin)) = other.value(StateIndex::origin);
  ud_.reset(index(StateIndex::distance), squared(std::min(distance_sigma_m, path_sigma_m)));
  ud_.reset(index(StateIndex::origin), squared(path_sigma_m));
}

double MotionFilter::sigma(StateIndex state) const {
  return std::sqrt(ud_.variance(index(state)));
}

double MotionFilter::path_sigma_m() const {
  StateVector h = zero_row();
  h(index(StateIndex::distance)) = 1;
  h(index(StateIndex::origin)) = 1;
  return std::sqrt(ud_.variance(h));
}

double MotionFilter::to_unit(Odometer odometer) const {
  return unit_ == Odometer::none || odometer == unit_ ? 1.0 : 1 + value(StateIndex::other_scale);
}

StateVector MotionFilter::scale_row(Odometer odometer) const {
  StateVector h = zero_row();
  h(index(StateIndex::unit_scale)) = 1;
  if (odometer != unit_) h(index(StateIndex::other_scale)) = 1;
  return h;
}

double MotionFilter::scale_sigma(Odometer odometer) const {
  return std::sqrt(ud_.variance(scale_row(odometer)));
}

OdometerScales MotionFilter::scales() const {
  if (unit_ == Odometer::none) return known_before_;
  const double camera = scale_sigma(Odometer::camera);
  const double wheel = scale_sigma(Odometer::wheel);
  const double sum = ud_.variance(StateVector(scale_row(Odometer::camera) + scale_row(Odometer::wheel)));
  const double covariance = 0.5 * (sum - squared(camera) - squared(wheel));
  return {scale(Odometer::camera) - 1, scale(Odometer::wheel) - 1, camera, wheel, covariance / (camera * wheel)};
}

std::optional<int> MotionFilter::clone_index(int64_t stamp_ns) const {
  const auto it = std::find(clones_.begin(), clones_.end(), stamp_ns);
  if (it == clones_.end()) return std::nullopt;
  return static_cast<int>(it - clones_.begin());
}

StateVector MotionFilter::zero_row() const {
  return StateVector::Zero(x_.size());
}

void MotionFilter::remove_clone(int index) {
  const auto behind = x_.size() - index - 1;
  StateVector x(x_.size() - 1);
  x << x_.head(index), x_.tail(behind);
  x_ = x;
  ud_.marginalise(index);
  clones_.erase(clones_.begin() + index);
}

Offer MotionFilter::offer(const StateVector& h, double residual, double sigma, double gate) {
  const double r = squared(sigma);
  const auto innovation = ud_.innovation(h, residual, r);
  // False for NaN, too.
  const bool inside = std::isfinite(innovation.variance) && innovation.nis <= squared(gate);
  if (inside) x_ += ud_.update(h, residual, r);
  return {inside, residual, innovation.nis};
}

}  // namespace railfix::fusion
