// IMU, wheel sensor and GNSS receiver of the virtual train, with their errors.
#pragma once

#include "dataset/dataset.hpp"
#include "simulator/trajectory.hpp"

namespace railfix::simulator {

/// A good MEMS unit, a worn wheel, a single-frequency receiver beside a line.
struct SensorOptions {
  double imu_hz = 200.0;
  double gyro_noise_rps = 0.002;  // 1 sigma a sample
  double gyro_bias_rps = 0.0005;  // 1 sigma of the constant bias, each axis
  double accel_noise_mps2 = 0.03;
  double accel_bias_mps2 = 0.02;
  double wheel_hz = 50.0;
  double pulses_per_metre = 50.0;
  double wheel_scale_error = 0.003;  // pulses are this share too many (worn wheel)
  int slip_episodes = 0;             // while accelerating (slip) or braking (slide)
  double slip_share = 0.15;          // wheel runs this share faster or slower
  double slip_s = 3.0;
  double gnss_hz = 1.0;
  double gnss_sigma_m = 1.5;  // horizontal, most of it slowly wandering
  double gnss_outlier_share = 0.01;
  double gnss_outlier_m = 15.0;
};

class SensorModel {
 public:
  SensorModel(const Trajectory& trajectory, const SensorOptions& options, uint64_t seed);
  [[nodiscard]] std::vector<dataset::ImuRow> imu() const;
  [[nodiscard]] std::vector<dataset::WheelRow> wheel() const;
  /// Empty without a crs (there is no latitude). Inside tunnels rows have fix 0 and NaN.
  [[nodiscard]] std::vector<dataset::GnssRow> gnss() const;
  /// What a faultless IMU would feel (body axes X forward, Y left, Z up; specific force).
  [[nodiscard]] dataset::ImuRow ideal_imu(double time_s) const;

 private:
  const Trajectory& trajectory_;
  SensorOptions options_;
  uint64_t seed_;
};

}  // namespace railfix::simulator
