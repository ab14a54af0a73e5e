#include "fusion/train_pose.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/time.hpp"
#include "core/units.hpp"

namespace railfix::fusion {
namespace {

constexpr double kRailSpacingM = 1.5;  // base of the cant
// Body against track, one sigma: suspension, load, and what the map does not say.
constexpr double kSuspensionRad = 0.015;
constexpr double kYawRad = 0.004;
constexpr double kUnknownCantRad = 0.04;
constexpr double kUnknownGradeRad = 0.012;

constexpr double kImuGapS = 0.2;
constexpr double kGainRps = 0.01;    // forgets in 5 s: a body that sways sideways feels no roll
constexpr double kSettleS = 25;      // until the orientation has forgotten its beginning
constexpr double kLearnLeastS = 10;  // of straight track before the IMU is asked
constexpr double kLearnS = 300;      // memory of the mean
constexpr int kBackwardToBelieve = 5;
constexpr double kWildRps = 1.0;
constexpr double kWildMps2 = 5.0;
constexpr double kCalmMps2 = 0.15;  // sideways or ahead: less leans nothing
// Of the measured angles, one sigma, beside their scatter about the track's on straights (sway, felt and true).
constexpr double kMeanRad = 0.010;  // of the mean's beginning; it shrinks with the square root of time over ...
constexpr double kMeanS = 10;       // ... this
constexpr double kCurvatureShare = 0.02;
constexpr double kAccelerationMps2 = 0.03;

double squared(double value) {
  return value * value;
}

// The sideways acceleration that cant does not balance, seen from the track.
double unbalanced_mps2(const track::TrackPoint& point, double speed_mps) {
  return squared(speed_mps) * point.curvature_per_m - core::kGravityMps2 * point.cant_m / kRailSpacingM;
}

PoseEstimate on_track(const TrainEstimate& state, const track::TrackPoint& point, const track::Alignment& alignment,
                      double map_sigma_m) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const bool heights = alignment.grade_known_at(state.position.offset_m);
  const bool cant = !alignment.cant().empty();
  PoseEstimate pose;
  pose.stamp_ns = state.stamp_ns;
  pose.easting_m = state.easting_m;
  pose.northing_m = state.northing_m;
  pose.height_m = heights ? point.elevation_m : nan;
  pose.along_sigma_m = state.sigma_m;
  pose.across_sigma_m = map_sigma_m;
  pose.height_sigma_m = heights ? std::hypot(map_sigma_m, point.grade * state.sigma_m) : nan;
  pose.heading_rad = state.heading_rad;
  pose.heading_sigma_rad = std::hypot(kYawRad, point.curvature_per_m * state.sigma_m);
  pose.pitch_rad = -std::atan(point.grade);
  pose.pitch_sigma_rad =
      std::hypot(kSuspensionRad, heights ? point.vertical_curvature_per_m * state.sigma_m : kUnknownGradeRad);
  pose.roll_rad = -std::atan(point.cant_m / kRailSpacingM);
  pose.roll_sigma_rad =
      std::hypot(kSuspensionRad, cant ? point.twist * state.sigma_m / kRailSpacingM : kUnknownCantRad);
  return pose;
}

}  // namespace

void TrainPose::restart() {
  orientation_ = Orientation(kGainRps);
  settled_s_ = 0;
}

void TrainPose::add(const BodySample& sample) {
  const double dt_s = core::seconds(sample.stamp_ns - imu_ns_);
  if (imu_ns_ != 0 && dt_s <= 0) {
    if (++backward_ >= kBackwardToBelieve) imu_ns_ = 0;  // the clock was set back
    return;
  }
  backward_ = 0;
  const bool wild =
      !(sample.rate_rps.norm() < kWildRps) || !(std::abs(sample.force_mps2.norm() - core::kGravityMps2) < kWildMps2);
  if (wild) return;
  if (imu_ns_ == 0 || dt_s > kImuGapS) {
    restart();
  } else {
    orientation_.add(body_from_imu_ * sample.rate_rps, body_from_imu_ * sample.force_mps2, expected_, dt_s);
    settled_s_ += dt_s;
  }
  imu_ns_ = sample.stamp_ns;
}

void TrainPose::learn_mount(const Angles& off, const track::TrackPoint& point, const TrainEstimate& state) {
  const double dt_s = std::clamp(core::seconds(state.stamp_ns - state_ns_), 0.0, kImuGapS);
  const bool calm = std::abs(unbalanced_mps2(point, state.speed_mps)) < kCalmMps2 &&
                    std::abs(state.acceleration_mps2) < kCalmMps2 && settled_s_ > kSettleS;
  if (!calm || dt_s == 0) return;
  const double share = dt_s / (std::min(learnt_s_, kLearnS) + dt_s);
  const Eigen::Quaterniond turn = Eigen::AngleAxisd(share * off.pitch_rad, Eigen::Vector3d::UnitY()) *
                                  Eigen::AngleAxisd(share * off.roll_rad, Eigen::Vector3d::UnitX());
  body_from_imu_ = (turn * body_from_imu_).normalized();
  orientation_.turn_body(turn);
  scatter_.pitch_rad += share * (squared(off.pitch_rad) - scatter_.pitch_rad);
  scatter_.roll_rad += share * (squared(off.roll_rad) - scatter_.roll_rad);
  learnt_s_ += dt_s;
}

PoseEstimate TrainPose::at(const TrainEstimate& state, const track::Path& path, bool imu_healthy) {
  const auto point = path.at(state.path_distance_m);
  const auto& alignment = path.map().edge(state.position.edge)->alignment;
  PoseEstimate pose = on_track(state, point, alignment, map_sigma_m_);
  const bool moved_known = std::isfinite(state.speed_mps);
  if (imu_healthy && moved_known && imu_ns_ != 0 && settled_s_ > kSettleS &&
      core::seconds(state.stamp_ns - imu_ns_) < kImuGapS) {
    turn_by_imu(pose, point, state);
  }
  expected_ = {moved_known ? state.speed_mps : 0, state.acceleration_mps2, point.curvature_per_m,
               point.vertical_curvature_per_m};
  state_ns_ = state.stamp_ns;
  return pose;
}

void TrainPose::turn_by_imu(PoseEstimate& pose, const track::TrackPoint& point, const TrainEstimate& state) {
  learn_mount({orientation_.pitch_rad() - pose.pitch_rad, orientation_.roll_rad() - pose.roll_rad}, point, state);
  if (learnt_s_ < kLearnLeastS) return;
  const double mean_rad = kMeanRad * std::sqrt(kMeanS / (kMeanS + std::min(learnt_s_, kLearnS)));
  // What the expected motion gets wrong: place and map in curves, acceleration ahead.
  const double sideways_mps2 = squared(state.speed_mps) * std::hypot(point.curvature_rate_per_m2 * state.sigma_m,
                                                                     kCurvatureShare * point.curvature_per_m);
  pose.from_imu = true;
  pose.pitch_rad = orientation_.pitch_rad();
  pose.roll_rad = orientation_.roll_rad();
  pose.pitch_sigma_rad = std::hypot(std::sqrt(scatter_.pitch_rad), mean_rad, kAccelerationMps2 / core::kGravityMps2);
  pose.roll_sigma_rad = std::hypot(std::sqrt(scatter_.roll_rad), mean_rad, sideways_mps2 / core::kGravityMps2);
}

}  // namespace railfix::fusion
