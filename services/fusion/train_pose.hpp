// The train in space (002, figure 7): the place from the map with its heights, heading, pitch and roll as the track
// lies, and around that what an IMU measures (Madgwick with paper 004, eq. 53).
//
// How the IMU is screwed on is not known: its mean against the track is learnt where the track is straight, standing
// lean of the body included; from then on curves and braking show as they are.
#pragma once

#include <cstdint>

#include "fusion/fusion_types.hpp"
#include "fusion/orientation.hpp"
#include "track/path.hpp"

namespace railfix::fusion {

/// Body axes X forward, Y left, Z up.
struct BodySample {
  int64_t stamp_ns = 0;
  Eigen::Vector3d rate_rps;
  Eigen::Vector3d force_mps2;
};

/// Fields as in msg::TrainPose; NaN = not known.
struct PoseEstimate {
  int64_t stamp_ns = 0;
  double easting_m = 0;
  double northing_m = 0;
  double height_m = 0;
  double along_sigma_m = 0;
  double across_sigma_m = 0;
  double height_sigma_m = 0;
  double heading_rad = 0;
  double pitch_rad = 0;
  double roll_rad = 0;
  double heading_sigma_rad = 0;
  double pitch_sigma_rad = 0;
  double roll_sigma_rad = 0;
  bool from_imu = false;
};

/// A plain value.
class TrainPose {
 public:
  /// map_sigma_m: of the track's place and height in the map.
  explicit TrainPose(double map_sigma_m) : map_sigma_m_(map_sigma_m) {}

  /// Samples in the order of their stamps; older ones and those that no train can feel are left out.
  void add(const BodySample& sample);
  /// REQUIRES: the state's track is known and lies on `path`. imu_healthy: nothing speaks against the IMU.
  PoseEstimate at(const TrainEstimate& state, const track::Path& path, bool imu_healthy);

 private:
  struct Angles {
    double pitch_rad = 0;
    double roll_rad = 0;
  };
  void restart();
  void turn_by_imu(PoseEstimate& pose, const track::TrackPoint& point, const TrainEstimate& state);
  void learn_mount(const Angles& off, const track::TrackPoint& point, const TrainEstimate& state);

  double map_sigma_m_;
  Orientation orientation_;
  ExpectedMotion expected_;  // of the newest state
  int64_t imu_ns_ = 0;       // newest sample
  double settled_s_ = 0;     // of samples without a gap
  int backward_ = 0;         // samples in a row that are older
  Angles scatter_;           // mean square of measured less track there
  Eigen::Quaterniond body_from_imu_ = Eigen::Quaterniond::Identity();
  double learnt_s_ = 0;  // over so much straight track
  int64_t state_ns_ = 0;
};

}  // namespace railfix::fusion
