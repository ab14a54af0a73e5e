// How the virtual train runs: speed profile, and the camera's shake; the exact truth at any time.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "dataset/dataset.hpp"
#include "simulator/line.hpp"
#include "simulator/shake_waves.hpp"

namespace railfix::simulator {

struct RunOptions {
  double length_m = 1000.0;  // way to run; 0 = as duration_s says
  double duration_s = 0.0;   // used when length_m is 0, dwells included
  double cruise_mps = 20.0;
  double accelerate_mps2 = 0.8;
  double brake_mps2 = 0.7;
  double dwell_s = 2.0;    // standing still at both ends
  double stop_at_m = 0.0;  // a station stop, 0 = none
  double stop_s = 20.0;
  int64_t begin_ns = 1'700'000'000'000'000'000;
};

/// Shake of the camera at 20 m/s, 1 sigma; grows with speed, is zero at standstill.
struct ShakeOptions {
  double scale = 1.0;
  double roll_rad = 0.0015;
  double pitch_rad = 0.0025;
  double yaw_rad = 0.0015;
  double lateral_m = 0.010;
  double height_m = 0.005;
  double rattle_rad = 0.0;  // fast pitching besides, 1 sigma
  double rattle_hz = 14.0;
  // The camera is knocked in its mount and stays so; the calibration does not know it.
  double knock_at_s = 0.0;  // 0 = never
  double knock_pitch_rad = 0.0;
  double knock_yaw_rad = 0.0;
};

/// Distance, speed and acceleration of one moment.
struct Motion {
  double distance_m = 0;
  double speed_mps = 0;
  double acceleration_mps2 = 0;
};

/// Read-only after it is made; may be used from many threads.
class Trajectory {
 public:
  Trajectory(std::shared_ptr<const Line> line, const RunOptions& run, const geometry::CameraPose& mount,
             const ShakeOptions& shake, uint64_t seed);

  [[nodiscard]] double duration_s() const { return duration_s_; }
  [[nodiscard]] double length_m() const { return motion(duration_s_).distance_m; }
  [[nodiscard]] int64_t begin_ns() const { return run_.begin_ns; }
  [[nodiscard]] Motion motion(double time_s) const;
  /// Shake alone, to be added to the mount.
  [[nodiscard]] geometry::CameraPose shake(double time_s) const;
  /// Everything that truth/track.csv says, at time_s after the beginning.
  [[nodiscard]] dataset::TruthRow truth(double time_s) const;
  [[nodiscard]] const Line& line() const { return *line_; }

 private:
  struct Phase {
    double begin_s, distance_m, speed_mps, acceleration_mps2;
  };
  void leg(double length_m, double cruise_mps);
  void phase(double duration_s, double acceleration_mps2);
  std::shared_ptr<const Line> line_;
  RunOptions run_;
  geometry::CameraPose mount_;
  ShakeOptions shake_;
  std::vector<Phase> phases_;
  std::array<ShakeWave, 2> rattle_{};
  ShakeWaves waves_[5];  // roll, pitch, yaw, lateral, height
  double duration_s_ = 0;
};

}  // namespace railfix::simulator
