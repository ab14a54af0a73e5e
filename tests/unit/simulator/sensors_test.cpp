#include "simulator/sensors.hpp"

#include <gmock/gmock.h>

#include <cmath>

#include "core/units.hpp"
#include "scene.hpp"

namespace railfix::simulator::sensors_test {
namespace {

const geometry::CameraPose kMount{0.0, 0.2094, 0.0, 0.0, 2.5};

Trajectory run(const std::string& start, double length_m, double shake = 0.0, double stop_at_m = 0.0) {
  RunOptions options;
  options.length_m = length_m;
  options.stop_at_m = stop_at_m;
  ShakeOptions shaking;
  shaking.scale = shake;
  return {line_from(start), options, kMount, shaking, 7};
}

TEST(Run, StandsRunsAndStandsAgain) {
  const auto trajectory = run("1:100", 400.0, 1.0, 150.0);
  EXPECT_NEAR(trajectory.length_m(), 400.0, 1e-6);
  EXPECT_EQ(trajectory.motion(1.9).distance_m, 0.0);
  EXPECT_EQ(trajectory.motion(trajectory.duration_s()).speed_mps, 0.0);
  double standing_s = 0.0;
  double before_m = 0.0;
  for (double t = 0.0; t < trajectory.duration_s(); t += 0.01) {
    const auto motion = trajectory.motion(t);
    EXPECT_GE(motion.distance_m, before_m);
    EXPECT_LE(motion.distance_m - before_m, 0.201);
    before_m = motion.distance_m;
    if (motion.speed_mps == 0.0) standing_s += 0.01;
  }
  EXPECT_NEAR(standing_s, 24.0, 0.1);  // 2 + 20 + 2
}

TEST(Run, StandsWhenThereIsNoTimeToMove) {
  RunOptions options;
  options.length_m = 0.0;
  options.duration_s = 4.0;
  const Trajectory trajectory(line_from("1:100"), options, kMount, {}, 7);
  EXPECT_NEAR(trajectory.duration_s(), 4.0, 1e-9);
  EXPECT_EQ(trajectory.length_m(), 0.0);
}

TEST(Run, CameraStandsStillWithTheTrain) {
  const auto trajectory = run("1:100", 200.0, 1.0);
  const auto a = trajectory.truth(0.5).camera;
  EXPECT_EQ(a.pitch_rad, kMount.pitch_rad);
  EXPECT_EQ(a.height_m, kMount.height_m);
  EXPECT_NE(trajectory.truth(10.0).camera.pitch_rad, kMount.pitch_rad);
}

TEST(Imu, FeelsTheTrack) {
  const auto trajectory = run("1:100", 400.0);
  const SensorModel sensors(trajectory, {}, 1);
  const auto standing = sensors.ideal_imu(1.0);
  EXPECT_NEAR(standing.accel_mps2[2], core::kGravityMps2, 1e-6);
  EXPECT_NEAR(sensors.ideal_imu(5.0).accel_mps2[0], 0.8, 1e-6);
  // Integrals over the run: heading from the gyro, about the plumb line that the canted body leans against.
  const auto& path = trajectory.line().path();
  double turned = 0.0;
  const double step_s = 0.005;
  for (double t = 0.0; t < trajectory.duration_s(); t += step_s) {
    const auto row = sensors.ideal_imu(t + 0.5 * step_s);
    const auto track = path.at(trajectory.motion(t + 0.5 * step_s).distance_m);
    const double lean_rad = -track.cant_m / kRailSpacingM;
    turned += step_s * (std::sin(lean_rad) * row.rate_rps[1] + std::cos(lean_rad) * row.rate_rps[2]);
  }
  EXPECT_NEAR(turned, core::wrap_pi(path.at(0.0).pose.heading_rad - path.at(400.0).pose.heading_rad), 1e-4);
}

TEST(Imu, CantAnswersTheCurve) {
  const auto trajectory = run("1:440", 380.0);  // R 600, 80 mm: balanced at about 64 km/h
  const SensorModel sensors(trajectory, {}, 1);
  double t = 2.0;
  while (trajectory.motion(t).distance_m < 80.0) t += 0.1;
  const double v = trajectory.motion(t).speed_mps;
  const double felt = sensors.ideal_imu(t).accel_mps2[1];
  EXPECT_NEAR(felt, v * v / 600.0 - core::kGravityMps2 * 0.08 / kRailSpacingM, 0.01);
}

TEST(Wheel, CountsTheWayWithItsScaleError) {
  const auto trajectory = run("1:100", 400.0);
  SensorOptions options;
  options.wheel_scale_error = 0.01;
  EXPECT_NEAR(static_cast<double>(SensorModel(trajectory, options, 1).wheel().back().pulses), 400.0 * 50.0 * 1.01, 1.5);
  options.slip_episodes = 3;
  EXPECT_NE(SensorModel(trajectory, options, 1).wheel().back().pulses,
            SensorModel(trajectory, SensorOptions{}, 1).wheel().back().pulses);
}

TEST(Gnss, NearTheTruthAndSilentInTheTunnel) {
  const auto trajectory = run("3:700", 300.0);
  const auto rows = SensorModel(trajectory, {}, 3).gnss();
  ASSERT_GT(rows.size(), 20U);
  size_t silent = 0;
  for (size_t k = 0; k < rows.size(); ++k) {
    const auto truth = trajectory.truth(static_cast<double>(k));
    const bool inside = trajectory.line().depth_in_tunnel_m(truth.distance_m) > 0.0;
    EXPECT_EQ(rows[k].fix == 0, inside);
    if (inside) {
      ++silent;
      continue;
    }
    const auto there = trajectory.line().path().map().from_geo({rows[k].lat_deg, rows[k].lon_deg});
    EXPECT_LT(std::hypot(there->x() - truth.easting_m, there->y() - truth.northing_m), 25.0);
  }
  EXPECT_GT(silent, 5U);
}

}  // namespace
}  // namespace railfix::simulator::sensors_test
