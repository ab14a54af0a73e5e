// Configuration of the fusion: section `fusion`.
#pragma once

#include <string>

#include "fusion/fusion_parameters.hpp"
#include "service/config.hpp"

namespace railfix::fusion {

struct FusionConfig {
  std::string map;
  std::string start = "unknown";
  std::string scales_file;
  bool use_camera = true;
  bool use_wheel = true;
  bool use_imu = true;
  bool use_gnss = true;
  bool use_fixes = true;
  FusionParameters parameters;

  void describe(service::Fields& fields) {
    fields.text("map", map, "Compiled map (railfix map build); empty = distance and speed only.");
    fields.text(
        "start", start,
        "Where the train begins, EDGE:OFFSET[:+|-] (+ = the cab looks towards growing offsets), or unknown: then "
        "a network fix of map_matcher decides.");
    fields.flag("use_camera", use_camera,
                "Use odometry_step; otherwise map_matcher, which believes no camera that fusion does not use, is led "
                "by the gyro, too.");
    fields.flag("use_wheel", use_wheel, "Use wheel_sample.");
    fields.flag("use_imu", use_imu, "Use imu_sample.");
    fields.flag("use_gnss", use_gnss, "Use gnss_fix.");
    fields.flag("use_fixes", use_fixes, "Use position_fix.");
    fields.text("scales_file", scales_file,
                "File on a lasting disk for the scales of camera and wheel: what references taught on one trip helps "
                "the next; empty = every trip begins anew.");
    describe_train(fields);
    describe_motion_sensors(fields);
    describe_position_sensors(fields);
    describe_limits(fields);
  }

 private:
  void describe_train(service::Fields& f) {
    auto& p = parameters;
    f.number("start_sigma_m", p.start_sigma_m, {0.01, 1e4}, "m", "One sigma of the configured start.");
    f.number("acceleration_sigma_mps2", p.acceleration_sigma_mps2, {0.01, 5}, "m/s^2",
             "Usual size of the train's acceleration.");
    f.number("acceleration_time_s", p.acceleration_time_s, {0.1, 100}, "s", "How long one acceleration lasts.");
  }
  void describe_motion_sensors(service::Fields& f) {
    auto& p = parameters;
    f.number("visual_scale_sigma", p.visual_scale_sigma, {1e-5, 0.2}, "",
             "How far the camera's metres may be off before references confirm them.");
    f.number("visual_scale_walk", p.visual_scale_walk, {0, 0.01}, "1/sqrt(m)",
             "How fast this changes: after 1 km by 32 times as much.");
    f.number("visual_creep", p.visual_creep, {0, 1}, "m/sqrt(m)",
             "What the camera's way strays beside its scale: after 100 m 10 times as much.");
    f.number("step_sigma_floor_m", p.step_sigma_floor_m, {1e-5, 1}, "m", "Least noise of one odometry step.");
    f.number("wheel_scale_sigma", p.wheel_scale_sigma, {1e-5, 0.2}, "", "The same for the wheel (wear, creep).");
    f.number("wheel_scale_walk", p.wheel_scale_walk, {0, 0.01}, "1/sqrt(m)", "The same for the wheel.");
    f.number("wheel_creep", p.wheel_creep, {0, 1}, "m/sqrt(m)", "The same for the wheel.");
    f.number("visual_scale_trip_sigma", p.visual_scale_trip_sigma, {0, 0.2}, "",
             "A scale in scales_file may have changed by so much before the next trip (lens, load, mount) ...");
    f.number("wheel_scale_trip_sigma", p.wheel_scale_trip_sigma, {0, 0.2}, "", "... the wheel's by so much ...");
    f.number("scale_sigma_per_day", p.scale_sigma_per_day, {0, 0.01}, "1/day", "... and both by so much more a day.");
    f.number("wheel_slip_share", p.wheel_slip_share, {0, 1}, "",
             "Where the wheel measures alone, a slip or slide may be this share of the speed ...");
    f.number("wheel_slip_s", p.wheel_slip_s, {0, 60}, "s", "... for so long ...");
    f.number("wheel_slip_per_m", p.wheel_slip_per_m, {0, 0.5}, "m/m", "... and all of them this share of a long way.");
    f.number("imu_period_s", p.imu_period_s, {0.001, 1}, "s", "Inertial samples are used as means over this time.");
    f.number("accel_sigma_mps2", p.accel_sigma_mps2, {0.001, 5}, "m/s^2", "Noise of such a mean.");
    f.number("accel_bias_sigma_mps2", p.accel_bias_sigma_mps2, {0.001, 5}, "m/s^2",
             "Accelerometer bias with the mount's tilt (1 degree is 0.17).");
    f.number("accel_bias_walk", p.accel_bias_walk, {0, 1}, "m/s^2/sqrt(s)", "How fast the bias may wander.");
    f.number("unknown_grade", p.unknown_grade, {0, 0.1}, "", "Grade to be expected where no map tells it ...");
    f.number("unknown_grade_m", p.unknown_grade_m, {10, 1e5}, "m",
             "... and the way over which it becomes another one.");
    f.number("gyro_period_s", p.gyro_period_s, {0.1, 10}, "s",
             "Turning is compared with the map's curvature as a mean over this time.");
    f.number("gyro_sigma_rps", p.gyro_sigma_rps, {1e-5, 1}, "rad/s", "Noise of such a mean, with the body's motion.");
  }
  void describe_position_sensors(service::Fields& f) {
    auto& p = parameters;
    f.number("gnss_single_sigma_m", p.gnss_single_sigma_m, {0.1, 100}, "m", "Single fix, at HDOP 1.");
    f.number("gnss_rtk_fixed_sigma_m", p.gnss_rtk_fixed_sigma_m, {0.005, 10}, "m", "RTK fixed, at HDOP 1.");
    f.number("gnss_rtk_float_sigma_m", p.gnss_rtk_float_sigma_m, {0.01, 50}, "m", "RTK float, at HDOP 1.");
    f.number("gnss_map_sigma_m", p.gnss_map_sigma_m, {0, 50}, "m", "Antenna's place on the train and map.");
    f.number("gnss_error_time_s", p.gnss_error_time_s, {0, 3600}, "s", "How long one error of GNSS lasts.");
    f.number("gnss_bound_m", p.gnss_bound_m, {0, 1000}, "m",
             "A lasting error of GNSS that agrees with the motion is no larger; the interval allows for it, ...");
    f.number("gnss_lag_s", p.gnss_lag_s, {0, 10}, "s", "... and for stamps that are so late.");
    f.number("gnss_antenna_ahead_m", p.gnss_antenna_ahead_m, {-500, 500}, "m", "Antenna ahead of the camera's foot.");
    f.number("shape_error_sigma_m", p.shape_error_sigma_m, {0, 100}, "m",
             "Fixes from the track's shape, and the turning, err alike by so much ...");
    f.number("shape_error_length_m", p.shape_error_length_m, {1, 1e6}, "m", "... over such a way.");
    f.number("fix_min_probability", p.fix_min_probability, {0, 1}, "", "Fixes that are less probable are left out.");
    f.number("fix_sigma_floor_m", p.fix_sigma_floor_m, {0.001, 10}, "m", "Least sigma of a fix.");
    f.number("place_shared_sigma_m", p.place_shared_sigma_m, {0, 10}, "m",
             "All fixes err alike by so much (mount, map): no number of them makes the place surer.");
  }
  void describe_limits(service::Fields& f) {
    auto& p = parameters;
    f.number("gate_camera", p.gate_camera, {1, 100}, "sigma", "An odometry step further off is refused.");
    f.number("gate_wheel", p.gate_wheel, {1, 100}, "sigma", "The same for wheel pulses (slip and slide).");
    f.number("gate_imu", p.gate_imu, {1, 100}, "sigma", "The same for acceleration.");
    f.number("gate_gyro", p.gate_gyro, {1, 100}, "sigma", "The same for turning.");
    f.number("gate_gnss", p.gate_gnss, {1, 100}, "sigma", "The same for GNSS.");
    f.number("gate_fix", p.gate_fix, {1, 100}, "sigma", "The same for position fixes.");
    f.number("interval_factor", p.interval_factor, {1, 20}, "sigma", "Promised interval: this many sigma ...");
    f.number("interval_floor_m", p.interval_floor_m, {0, 50}, "m", "... and this much in any case ...");
    f.number("interval_drift", p.interval_drift, {0, 0.5}, "m/m",
             "... and this share of the way since the last fix (not a vague one).");
    f.number("budget_m", p.budget_m, {0.1, 1000}, "m", "Allowed interval (SUBSET-041): this much ...");
    f.number("budget_per_m", p.budget_per_m, {0, 1}, "m/m", "... and this share of the way since the reference.");
    f.number("unusable_budgets", p.unusable_budgets, {1, 1000}, "", "An interval of so many budgets is no position.");
    f.number("sensor_timeout_s", p.sensor_timeout_s, {0.02, 60}, "s", "A sensor silent for longer is reported.");
    f.number("output_period_s", p.output_period_s, {0.01, 0.1}, "s",
             "Period of train_state without a camera. Readers turn to a standby 0.15 s after the last one.");
    f.number("history_s", p.history_s, {1.2, 60}, "s",
             "A measurement that comes later than this is left out; slips are taken back over 1.2 s.");
    f.number("max_jump_s", p.max_jump_s, {0.1, 3600}, "s", "A stamp further ahead is not believed at once.");
    f.number("camera_lag_s", p.camera_lag_s, {0, 1}, "s",
             "Camera stamps that are, or may be, further off those of the wheel widen the interval by the way run "
             "meanwhile.");
  }
};

}  // namespace railfix::fusion
