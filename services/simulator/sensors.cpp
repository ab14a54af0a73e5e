#include "simulator/sensors.hpp"

#include <Eigen/Geometry>
#include <cmath>
#include <limits>

#include "core/random.hpp"
#include "core/time.hpp"
#include "core/units.hpp"

namespace railfix::simulator {
namespace {

constexpr double kHalfStepS = 0.002;  // of numeric derivatives of the shake
constexpr double kWanderS = 60.0;     // correlation time of GNSS errors
constexpr double kGeoidM = 48.0;

Eigen::Matrix3d track_from_body(const geometry::CameraPose& shake) {
  return (Eigen::AngleAxisd(shake.yaw_rad, Eigen::Vector3d::UnitZ()) *
          Eigen::AngleAxisd(shake.pitch_rad, Eigen::Vector3d::UnitY()) *
          Eigen::AngleAxisd(shake.roll_rad, Eigen::Vector3d::UnitX()))
      .toRotationMatrix();
}

size_t samples(double duration_s, double rate_hz) {
  return rate_hz > 0.0 ? static_cast<size_t>(duration_s * rate_hz) + 1 : 0;
}

}  // namespace

SensorModel::SensorModel(const Trajectory& trajectory, const SensorOptions& options, uint64_t seed)
    : trajectory_(trajectory), options_(options), seed_(seed) {}

dataset::ImuRow SensorModel::ideal_imu(double time_s) const {
  const auto motion = trajectory_.motion(time_s);
  const auto track = trajectory_.line().path().at(motion.distance_m);
  const double v = motion.speed_mps;
  const auto shake = trajectory_.shake(time_s);
  const auto before = trajectory_.shake(time_s - kHalfStepS);
  const auto after = trajectory_.shake(time_s + kHalfStepS);
  const auto rate = [](double a, double b) { return (b - a) / (2.0 * kHalfStepS); };
  const auto bend = [](double a, double m, double b) { return (a - 2.0 * m + b) / (kHalfStepS * kHalfStepS); };

  const double lean_rad = -track.cant_m / kRailSpacingM;  // about X, left side up
  const Eigen::Vector3d up_in_track(track.grade, std::sin(lean_rad), std::cos(lean_rad));
  // The curve turns about the plumb line and the grade about the horizontal; both lean in the track's axes.
  const Eigen::Vector3d left_in_track(0, std::cos(lean_rad), -std::sin(lean_rad));
  const Eigen::Vector3d turning = Eigen::Vector3d(-v * track.twist / kRailSpacingM, 0, 0) -
                                  v * track.vertical_curvature_per_m * left_in_track +
                                  v * track.curvature_per_m * up_in_track;
  const Eigen::Vector3d shaking(rate(before.roll_rad, after.roll_rad), rate(before.pitch_rad, after.pitch_rad),
                                rate(before.yaw_rad, after.yaw_rad));
  // Centripetal acceleration is horizontal; the track axes lean.
  const double across = v * v * track.curvature_per_m;
  Eigen::Vector3d accelerating(motion.acceleration_mps2, across * std::cos(lean_rad),
                               v * v * track.vertical_curvature_per_m - across * std::sin(lean_rad));
  accelerating.y() += bend(before.lateral_m, shake.lateral_m, after.lateral_m);
  accelerating.z() += bend(before.height_m, shake.height_m, after.height_m);

  const Eigen::Matrix3d body_from_track = track_from_body(shake).transpose();
  const Eigen::Vector3d rates = body_from_track * turning + shaking;
  const Eigen::Vector3d force = body_from_track * (accelerating + core::kGravityMps2 * up_in_track);
  dataset::ImuRow row;
  row.stamp_ns = trajectory_.begin_ns() + core::to_ns(time_s);
  for (int i = 0; i < 3; ++i) {
    row.rate_rps[i] = rates[i];
    row.accel_mps2[i] = force[i];
  }
  return row;
}

std::vector<dataset::ImuRow> SensorModel::imu() const {
  core::Random random(seed_ + 1);
  double gyro_bias[3];
  double accel_bias[3];
  for (int i = 0; i < 3; ++i) {
    gyro_bias[i] = random.normal(0.0, options_.gyro_bias_rps);
    accel_bias[i] = random.normal(0.0, options_.accel_bias_mps2);
  }
  std::vector<dataset::ImuRow> rows;
  const size_t count = samples(trajectory_.duration_s(), options_.imu_hz);
  for (size_t k = 0; k < count; ++k) {
    auto row = ideal_imu(static_cast<double>(k) / options_.imu_hz);
    for (int i = 0; i < 3; ++i) {
      row.rate_rps[i] += random.normal(gyro_bias[i], options_.gyro_noise_rps);
      row.accel_mps2[i] += random.normal(accel_bias[i], options_.accel_noise_mps2);
    }
    rows.push_back(row);
  }
  return rows;
}

std::vector<dataset::WheelRow> SensorModel::wheel() const {
  core::Random random(seed_ + 2);
  std::vector<double> slips;  // where driving or braking forces act
  for (int tries = 0; tries < 1000 && static_cast<int>(slips.size()) < options_.slip_episodes; ++tries) {
    const double begin_s = random.uniform(0.0, trajectory_.duration_s());
    if (trajectory_.motion(begin_s).acceleration_mps2 != 0.0) slips.push_back(begin_s);
  }
  std::vector<dataset::WheelRow> rows;
  double wheel_m = 0.0;
  double last_m = 0.0;
  const size_t count = samples(trajectory_.duration_s(), options_.wheel_hz);
  for (size_t k = 0; k < count; ++k) {
    const double time_s = static_cast<double>(k) / options_.wheel_hz;
    const auto motion = trajectory_.motion(time_s);
    double share = 1.0 + options_.wheel_scale_error;
    for (const double begin_s : slips) {
      if (time_s >= begin_s && time_s < begin_s + options_.slip_s)
        share += std::copysign(options_.slip_share, motion.acceleration_mps2);
    }
    wheel_m += share * (motion.distance_m - last_m);
    last_m = motion.distance_m;
    rows.push_back({trajectory_.begin_ns() + core::to_ns(time_s),
                    static_cast<int64_t>(std::floor(wheel_m * options_.pulses_per_metre))});
  }
  return rows;
}

std::vector<dataset::GnssRow> SensorModel::gnss() const {
  core::Random random(seed_ + 3);
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  const double slow_sigma = 0.9 * options_.gnss_sigma_m;
  const double fast_sigma = 0.43 * options_.gnss_sigma_m;  // squares add up to the whole
  const double keep = options_.gnss_hz > 0.0 ? std::exp(-1.0 / (options_.gnss_hz * kWanderS)) : 0.0;
  const double kick = slow_sigma * std::sqrt(1.0 - keep * keep);
  double slow[3] = {random.normal(0.0, slow_sigma), random.normal(0.0, slow_sigma), random.normal(0.0, slow_sigma)};
  std::vector<dataset::GnssRow> rows;
  const auto& map = trajectory_.line().path().map();
  const size_t count = samples(trajectory_.duration_s(), options_.gnss_hz);
  for (size_t k = 0; k < count; ++k) {
    const auto truth = trajectory_.truth(static_cast<double>(k) / options_.gnss_hz);
    double error[3];
    for (int i = 0; i < 3; ++i) {
      slow[i] = keep * slow[i] + random.normal(0.0, kick);
      error[i] = slow[i] + random.normal(0.0, fast_sigma);
    }
    if (random.uniform() < options_.gnss_outlier_share) {
      const double direction = random.uniform(0.0, 2.0 * core::kPi);
      error[0] += options_.gnss_outlier_m * std::cos(direction);
      error[1] += options_.gnss_outlier_m * std::sin(direction);
    }
    dataset::GnssRow row{truth.stamp_ns, kNone, kNone, kNone, kNone, 0};
    if (trajectory_.line().depth_in_tunnel_m(truth.distance_m) <= 0.0) {
      const auto geo = map.to_geo(truth.easting_m + error[0], truth.northing_m + error[1]);
      if (!geo) return {};
      const double elevation_m = trajectory_.line().path().at(truth.distance_m).elevation_m;
      row = {truth.stamp_ns, geo->lat_deg, geo->lon_deg, elevation_m + kGeoidM + 1.6 * error[2], 0.9, 1};
    }
    rows.push_back(row);
  }
  return rows;
}

}  // namespace railfix::simulator
