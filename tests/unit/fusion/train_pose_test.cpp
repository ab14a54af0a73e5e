#include "fusion/train_pose.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "core/random.hpp"
#include "core/time.hpp"
#include "simulator/builtin_line.hpp"
#include "simulator/sensors.hpp"

namespace railfix::fusion::train_pose_test {
namespace {

using simulator::Trajectory;

constexpr double kTiltPitchRad = 0.03;  // of the IMU in the body
constexpr double kTiltRollRad = -0.02;
constexpr double kStateS = 0.1;

std::shared_ptr<const simulator::Line> long_line() {
  const auto map = std::make_shared<const track::Map>(simulator::builtin_line("long").value());
  return std::make_shared<const simulator::Line>(
      simulator::Line::make(map, map->parse_position("1:100").value(), 13000.0, {}).value());
}

// 12 km of curves, cant and grades at up to 108 km/h, the body swaying.
Trajectory ride(uint64_t seed, double scale) {
  simulator::RunOptions run;
  run.length_m = 12000;
  run.cruise_mps = 30;
  run.stop_at_m = 6000;
  simulator::ShakeOptions shake;
  shake.scale = scale;
  return {long_line(), run, {0, 0, 0, 0, 2.5}, shake, seed};
}

BodySample felt(const dataset::ImuRow& row) {
  const Eigen::Matrix3d tilted = (Eigen::AngleAxisd(kTiltPitchRad, Eigen::Vector3d::UnitY()) *
                                  Eigen::AngleAxisd(kTiltRollRad, Eigen::Vector3d::UnitX()))
                                     .toRotationMatrix()
                                     .transpose();
  return {row.stamp_ns, tilted * Eigen::Vector3d(row.rate_rps[0], row.rate_rps[1], row.rate_rps[2]),
          tilted * Eigen::Vector3d(row.accel_mps2[0], row.accel_mps2[1], row.accel_mps2[2])};
}

// As fusion knows the train: half a metre off, the acceleration noisy.
TrainEstimate state_of(const Trajectory& trajectory, double time_s, core::Random& random) {
  const auto motion = trajectory.motion(time_s);
  const auto& path = trajectory.line().path();
  TrainEstimate state;
  state.stamp_ns = trajectory.begin_ns() + core::to_ns(time_s);
  state.track_known = true;
  state.path_distance_m = motion.distance_m + 0.5;
  state.position = path.position_at(state.path_distance_m);
  state.speed_mps = motion.speed_mps;
  state.acceleration_mps2 = motion.acceleration_mps2 + 0.05 * random.normal();
  state.sigma_m = 0.5;
  const auto pose = path.at(state.path_distance_m).pose;
  state.easting_m = pose.easting_m;
  state.northing_m = pose.northing_m;
  state.heading_rad = pose.heading_rad;
  return state;
}

struct Errors {
  double squares = 0;
  double ratio_squares = 0;
  double worst_ratio = 0;
  int count = 0;
  void add(double error, double sigma) {
    squares += error * error;
    ratio_squares += error * error / sigma / sigma;
    worst_ratio = std::max(worst_ratio, std::abs(error) / sigma);
    ++count;
  }
  [[nodiscard]] double rms() const { return std::sqrt(squares / count); }
  [[nodiscard]] double ratio() const { return std::sqrt(ratio_squares / count); }
};

struct Ride {
  Errors pitch, roll, track_pitch, track_roll;
  int from_imu = 0;
  int states = 0;
};

Ride follow(const Trajectory& trajectory, bool imu, uint64_t seed) {
  const auto rows = simulator::SensorModel(trajectory, {}, seed).imu();
  core::Random random(seed);
  TrainPose pose(0.3);
  Ride result;
  size_t next = 0;
  for (double t = kStateS; t < trajectory.duration_s(); t += kStateS) {
    const auto state = state_of(trajectory, t, random);
    for (; imu && next < rows.size() && rows[next].stamp_ns <= state.stamp_ns; ++next) pose.add(felt(rows[next]));
    const auto said = pose.at(state, trajectory.line().path(), true);
    const auto track = trajectory.line().path().at(trajectory.motion(t).distance_m);
    const auto shake = trajectory.shake(t);
    const double true_pitch = -std::atan(track.grade) + shake.pitch_rad;
    const double true_roll = -track.cant_m / simulator::kRailSpacingM + shake.roll_rad;
    result.pitch.add(said.pitch_rad - true_pitch, said.pitch_sigma_rad);
    result.roll.add(said.roll_rad - true_roll, said.roll_sigma_rad);
    result.from_imu += said.from_imu ? 1 : 0;
    ++result.states;
    EXPECT_NEAR(said.height_m, track.elevation_m, 4 * said.height_sigma_m);
  }
  return result;
}

void print(const char* what, const Errors& e) {
  std::printf("  %s: %.2f mrad rms, rms error over sigma %.2f, worst %.2f\n", what, 1000 * e.rms(), e.ratio(),
              e.worst_ratio);
}

TEST(TrainPose, TheImuTellsHowTheBodyLiesAndItsSigmasHold) {
  for (const double scale : {0.5, 1.0, 2.0}) {
    const auto trajectory = ride(5, scale);
    const auto with = follow(trajectory, true, 5);
    const auto without = follow(trajectory, false, 5);
    EXPECT_EQ(without.from_imu, 0);
    EXPECT_GT(with.from_imu, with.states * 3 / 4);
    EXPECT_LT(with.pitch.rms(), 0.6 * without.pitch.rms());
    for (const auto* errors : {&with.pitch, &with.roll, &without.pitch, &without.roll}) {
      EXPECT_LT(errors->ratio(), 1.2);
      EXPECT_LT(errors->worst_ratio, 5);
    }
    std::printf("sway times %g\n", scale);
    print("pitch, IMU", with.pitch);
    print("roll, IMU", with.roll);
    print("pitch, track", without.pitch);
    print("roll, track", without.roll);
  }
}

TEST(TrainPose, WhatNoTrainCanFeelIsLeftOut) {
  const auto trajectory = ride(6, 1);
  core::Random random(1);
  const auto rows = simulator::SensorModel(trajectory, {}, 6).imu();
  TrainPose clean(0.3);
  TrainPose disturbed(0.3);
  for (size_t i = 0; i < 20000; ++i) {
    clean.add(felt(rows[i]));
    disturbed.add(felt(rows[i]));
    auto wild = felt(rows[i]);
    wild.stamp_ns += 1'000'000;
    wild.force_mps2.x() = std::nan("");
    disturbed.add(wild);
    wild.force_mps2.x() = 50;
    disturbed.add(wild);
    disturbed.add(felt(rows[i / 2]));  // again, too late
    if (i % 20 != 0) continue;
    const auto state = state_of(trajectory, core::seconds(rows[i].stamp_ns - trajectory.begin_ns()), random);
    const auto a = clean.at(state, trajectory.line().path(), true);
    const auto b = disturbed.at(state, trajectory.line().path(), true);
    ASSERT_EQ(a.roll_rad, b.roll_rad);
    ASSERT_EQ(a.pitch_rad, b.pitch_rad);
  }
}

TEST(TrainPose, AnIsolatedOrSilentImuIsNotAskedAndAMapWithoutHeightsHasNone) {
  auto map = std::make_shared<track::Map>();
  map->edges.push_back({1, "line", 1, 2, "", track::Alignment::chained({0, 0, 0}, {{5000, 0, 0}})});
  map->nodes = {{1, track::NodeKind::end, "", 0, 0}, {2, track::NodeKind::end, "", 0, 5000}};
  const auto path = track::Path::follow(map, {1, 100, track::Direction::forward}, 4000, 100).value();
  TrainPose pose(0.3);
  const auto state_at = [&](double t_s) {
    TrainEstimate state;
    state.stamp_ns = core::to_ns(t_s);
    state.track_known = true;
    state.position = path.position_at(0);
    return state;
  };
  for (double t = 0.01; t < 60; t += 0.01) {
    pose.add({core::to_ns(t), {0, 0, 0}, {0.3, 0, 9.8}});
    if (t > 59) continue;
    pose.at(state_at(t), path, true);
  }
  const auto said = pose.at(state_at(60), path, true);
  EXPECT_TRUE(said.from_imu);
  EXPECT_NEAR(said.pitch_rad, 0, 1e-3) << "the IMU's own tilt";
  EXPECT_TRUE(std::isnan(said.height_m));
  EXPECT_TRUE(std::isnan(said.height_sigma_m));
  EXPECT_FALSE(pose.at(state_at(60), path, false).from_imu);
  EXPECT_FALSE(pose.at(state_at(60.5), path, true).from_imu);
}

TEST(TrainPose, HeightsThatAreAGuessAreNone) {
  auto map = std::make_shared<track::Map>();
  map->edges.push_back(
      {1, "line", 1, 2, "",
       track::Alignment::chained({0, 0, 0}, {{2000, 0, 0}}, {{0, 0, 0, true}, {1000, 20, 0}, {2000, 30, 0}})});
  map->nodes = {{1, track::NodeKind::end, "", 0, 0}, {2, track::NodeKind::end, "", 0, 2000}};
  const auto path = track::Path::follow(map, {1, 0, track::Direction::forward}, 2000, 0).value();
  const auto said = [&](double distance_m) {
    TrainEstimate state;
    state.track_known = true;
    state.path_distance_m = distance_m;
    state.position = path.position_at(distance_m);
    return TrainPose(0.3).at(state, path, false);
  };
  EXPECT_TRUE(std::isnan(said(500).height_m));
  EXPECT_NEAR(said(1500).height_m, 25, 1e-9);
  EXPECT_GT(said(500).pitch_sigma_rad, 1.2 * said(1500).pitch_sigma_rad);
}

}  // namespace
}  // namespace railfix::fusion::train_pose_test
