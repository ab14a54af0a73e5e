// What fusion assumes of the train and its sensors. Defaults fit an electric passenger train; every one is a
// configuration key.
#pragma once

#include <cstdint>

namespace railfix::fusion {

inline constexpr double kGyroBiasSigmaRps = 0.01;  // of any gyro's before anything has told

struct FusionParameters {
  // The train.
  double start_sigma_m = 1.0;            // of the configured start
  double acceleration_sigma_mps2 = 0.4;  // usual size of its acceleration ...
  double acceleration_time_s = 8.0;      // ... and how long one value lasts

  // Camera and wheel: true over measured metres, which walks at random along the way (per square root of a metre), and
  // what each strays beside it (metres per square root of a metre).
  double visual_scale_sigma = 0.01;
  double visual_scale_walk = 1e-5;
  double visual_creep = 0.006;
  double step_sigma_floor_m = 0.001;
  double wheel_scale_sigma = 0.01;
  double wheel_scale_walk = 3e-6;
  double wheel_creep = 0.001;
  // What a saved scale may have changed by before the next trip: once, and more for every day.
  double visual_scale_trip_sigma = 5e-4;
  double wheel_scale_trip_sigma = 1e-4;
  double scale_sigma_per_day = 1e-4;

  // What a slip or slide can add that no other sensor would see: once, and over a long way.
  double wheel_slip_share = 0.3;  // of the speed ...
  double wheel_slip_s = 8.0;      // ... for so long
  double wheel_slip_per_m = 0.05;

  // IMU: noise of the mean over imu_period_s, bias with the mount's pitch in it.
  double imu_period_s = 0.05;
  double accel_sigma_mps2 = 0.15;
  double accel_bias_sigma_mps2 = 0.15;
  double accel_bias_walk = 0.003;  // m/s^2 per square root of a second
  double unknown_grade = 0.03;     // grade that must be expected where no map tells it ...
  double unknown_grade_m = 500.0;  // ... and the way over which it becomes another one

  double gyro_period_s = 1.0;     // of yaw rate against the map's curvature
  double gyro_sigma_rps = 0.004;  // of its mean, with the car body's own turning

  // GNSS: position noise per unit of HDOP or of the RTK solution; most of it lasts.
  double gnss_single_sigma_m = 3.0;
  double gnss_rtk_fixed_sigma_m = 0.05;
  double gnss_rtk_float_sigma_m = 0.5;
  double gnss_map_sigma_m = 0.3;  // antenna's lever arm and map
  double gnss_error_time_s = 60.0;
  double gnss_bound_m = 30.0;         // an error that the tests do not see is no larger, ...
  double gnss_lag_s = 1.0;            // ... but for a stamp that is so late
  double gnss_antenna_ahead_m = 0.0;  // of the camera's foot

  // The shape of the track (fixes of kind curvature, turning): it lies elsewhere than on the map, and seems to.
  double shape_error_sigma_m = 1.0;
  double shape_error_length_m = 2000.0;

  // Fixes.
  double fix_min_probability = 0.9;
  double fix_sigma_floor_m = 0.05;
  double place_shared_sigma_m = 0.12;  // all of them are wrong alike by it: the mount's pitch, the map's datum

  // Tests on innovations, in standard deviations.
  double gate_camera = 5.0;
  double gate_wheel = 5.0;
  double gate_imu = 5.0;
  double gate_gyro = 3.0;
  double gate_gnss = 4.0;
  double gate_fix = 4.0;

  // The interval that is promised: factor * sigma + floor + drift * distance since the last fix that was not vague.
  double interval_factor = 4.0;
  double interval_floor_m = 0.5;
  double interval_drift = 0.003;
  // What is still good, counted from the reference: SUBSET-041.
  double budget_m = 5.0;
  double budget_per_m = 0.05;
  double unusable_budgets = 4.0;  // an interval of so many budgets is no position
  /// Half an interval may be so long so far behind the reference.
  [[nodiscard]] double allowed_m(double since_m) const { return budget_m + budget_per_m * since_m; }

  double sensor_timeout_s = 0.5;  // a sensor that was there and is silent for longer is reported
  double output_period_s = 0.1;   // of states without a camera
  double history_s = 3.0;         // a measurement older than this is too late
  double max_jump_s = 2.0;        // a stamp further ahead is not believed at once
  double camera_lag_s = 0.02;     // the camera's stamps may be so far off the wheel's
};

}  // namespace railfix::fusion
