// Roll and pitch of the car body from an IMU: Madgwick's gradient filter (2011), with the acceleration that speed and
// the map's curvature make expected taken off first (paper 004, eq. 53). Without that a curve reads as roll.
#pragma once

#include <Eigen/Geometry>

namespace railfix::fusion {

/// What a train that follows the track feels besides gravity; curvatures as in track::TrackPoint.
struct ExpectedMotion {
  double speed_mps = 0;
  double acceleration_mps2 = 0;
  double curvature_per_m = 0;           // left positive
  double vertical_curvature_per_m = 0;  // hollow positive
};

/// A plain value. Body axes X forward, Y left, Z up; heading is not observed and drifts with the gyro.
class Orientation {
 public:
  /// gain: rad/s by which the accelerometer pulls the gyro's integral.
  explicit Orientation(double gain_rps = 0.02) : gain_rps_(gain_rps) {}

  /// rate_rps and force_mps2 (specific force: +9.81 on Z at rest) of one sample, dt_s after the one before.
  void add(const Eigen::Vector3d& rate_rps, const Eigen::Vector3d& force_mps2, const ExpectedMotion& expected,
           double dt_s);
  /// The body's axes become others: body_from_before turns vectors of the old ones.
  void turn_body(const Eigen::Quaterniond& body_from_before) {
    world_from_body_ = (world_from_body_ * body_from_before.conjugate()).normalized();
  }
  /// Left side up positive.
  [[nodiscard]] double roll_rad() const;
  /// Nose down positive.
  [[nodiscard]] double pitch_rad() const;

 private:
  double gain_rps_;
  Eigen::Quaterniond world_from_body_ = Eigen::Quaterniond::Identity();
};

}  // namespace railfix::fusion
