// What a train's sensors say of how it turns and how far it runs, straight from the curvature of a track: no pictures,
// a thousand rides a second. Used by tests and benchmarks of everything behind the sensors.
#pragma once

#include <algorithm>
#include <cmath>
#include <functional>
#include <utility>
#include <vector>

#include "core/random.hpp"
#include "simulator/shake_waves.hpp"

namespace railfix::testing {

struct RideErrors {
  double odometer_scale = 0.01;    // measured metres are so much too long
  double turn_bias_rps = 0.002;    // constant turning of the sensor (uncalibrated cheap IMU: 0.1 deg/s)
  double turn_noise_rps = 0.01;    // of one sample
  double step_turn_noise_rad = 0;  // of one step, whatever its length (a camera)
  double hunting_rad = 3e-4;       // the body turns to and fro on straight track, ...
  double hunting_m = 12;           // ... once in so many metres
  double sway_rad = 0.0015;        // the body sways as the simulator's: 1 sigma at 20 m/s
  double bogies_behind_m = 3;      // the front bogie is so far behind the foot ...
  double bogie_distance_m = 17;    // ... and the second behind it; 0 and 0: the foot turns with the track below it
};

/// One step of the sensors; `at_m` is the truth.
struct SensedStep {
  double time_s = 0;
  double at_m = 0;
  double speed_mps = 0;
  double way_m = 0;  // measured
  double turn_rad = 0;
  double turn_sigma_rad = 0;
  double duration_s = 0;
};

/// The heading of a vehicle on a track of this curvature (left positive), for places from first_m to last_m.
class VehicleHeading {
 public:
  VehicleHeading(const std::function<double(double)>& curvature_per_m, double first_m, double last_m,
                 const RideErrors& errors)
      : first_m_(first_m), errors_(errors) {
    double heading = 0;
    for (double m = first_m; m <= last_m + kStepM; m += kStepM) {
      track_.push_back(heading);
      heading += kStepM * curvature_per_m(m + 0.5 * kStepM);
    }
    // A second sum makes the mean over the distance of the bogies cheap.
    sum_.push_back(0);
    for (const double h : track_) sum_.push_back(sum_.back() + kStepM * h);
  }
  [[nodiscard]] double at(double place_m) const {
    const double front_m = place_m - errors_.bogies_behind_m;
    if (errors_.bogie_distance_m < 2 * kStepM) return of_track(front_m);
    const double back_m = front_m - errors_.bogie_distance_m;
    return (sum_to(front_m) - sum_to(back_m)) / errors_.bogie_distance_m;
  }

 private:
  static constexpr double kStepM = 0.5;
  [[nodiscard]] double cell(double m, size_t size) const {
    return std::clamp((m - first_m_) / kStepM, 0.0, static_cast<double>(size) - 1.001);
  }
  [[nodiscard]] double of_track(double m) const { return between(track_, cell(m, track_.size())); }
  [[nodiscard]] double sum_to(double m) const { return between(sum_, cell(m, sum_.size())); }
  static double between(const std::vector<double>& values, double cell) {
    const auto i = static_cast<size_t>(cell);
    return values[i] + (cell - static_cast<double>(i)) * (values[i + 1] - values[i]);
  }
  double first_m_;
  RideErrors errors_;
  std::vector<double> track_;
  std::vector<double> sum_;
};

/// The sensors of one train; steps are asked for one after the other.
class RideSensors {
 public:
  RideSensors(const RideErrors& errors, uint64_t seed) : errors_(errors), random_(seed) {
    phase_ = random_.uniform(0, 6.28);
    if (errors.sway_rad > 0) sway_ = simulator::ShakeWaves(errors.sway_rad, random_);
  }
  SensedStep step(const VehicleHeading& heading, double time_s, double from_m, double to_m, double duration_s) {
    SensedStep s{time_s, to_m,      (to_m - from_m) / duration_s, (to_m - from_m) * (1 + errors_.odometer_scale), 0,
                 0,      duration_s};
    const auto hunting = [&](double m) {
      return errors_.hunting_rad * std::sin(phase_ + 6.283 * m / errors_.hunting_m);
    };
    const double share = std::sqrt(std::min(1.0, std::abs(to_m - from_m) / kKeyFrameM));  // key frames while it is slow
    s.turn_sigma_rad = std::hypot(errors_.turn_noise_rps * duration_s, share * errors_.step_turn_noise_rad);
    s.turn_rad = heading.at(to_m) - heading.at(from_m) + hunting(to_m) - hunting(from_m) +
                 errors_.turn_bias_rps * duration_s + s.turn_sigma_rad * random_.normal();
    run_s_ += duration_s;
    const double swayed_before_rad = std::exchange(swayed_rad_, sway_.at(run_s_, std::abs(s.speed_mps)));
    s.turn_rad += swayed_rad_ - swayed_before_rad;
    return s;
  }

 private:
  static constexpr double kKeyFrameM = 0.15;
  simulator::ShakeWaves sway_;
  double swayed_rad_ = 0;
  double run_s_ = 0;
  RideErrors errors_;
  core::Random random_;
  double phase_ = 0;
};

}  // namespace railfix::testing
