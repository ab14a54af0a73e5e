// What a gyro in the body says about the roll of the camera against the track, as a prior for the rails' fit.
//
// A gyro measures how the body turns against inertial space: its sway on the springs and the twist of the track below
// it (cant ramps) together, and an accelerometer their sum against gravity; neither knows the cant. So only what swings
// faster than track twists is the sway's: a resonance (the body on its springs, stationary with the suspension limit)
// beside a slowly wandering rate (twist, gyro bias), both in one Kalman filter. The standing part of the roll (load,
// wind, unbalanced cant) stays with the suspension limit.
#pragma once

#include <cstdint>
#include <deque>
#include <optional>

#include "estimation/ud_filter.hpp"
#include "geometry/camera.hpp"
#include "track_detector/track_detector.hpp"

namespace railfix::track_detector {

struct ImuRollOptions {
  bool use = true;
  double sway_hz = 0.7;      // of the body on its springs
  double slow_rad = 0.003;   // standing roll, one sigma
  double twist_rps = 0.010;  // turning of the track under the train, and bias of the gyro, one sigma
  double noise_rps = 0.003;  // of a gyro sample, one sigma
};

class ImuRoll {
 public:
  /// `limit_rad`: one sigma of the whole roll about the mount.
  ImuRoll(const ImuRollOptions& options, const geometry::CameraPose& mount, double limit_rad);

  /// Rate about the body's X axis (forward). Out of order or not finite: left out.
  void add(int64_t stamp_ns, double rate_x_rps);
  /// The prior for the picture of this time; nothing while there are no samples, or only old ones. Takes the samples up
  /// to the picture asked for before and predicts from there: the same data give the same answer whether the newest
  /// samples come a little before or behind the picture, and nothing waits for them.
  std::optional<RollHint> at(int64_t stamp_ns);

 private:
  struct Sample {
    int64_t stamp_ns;
    double rate_rps;
  };
  void know_nothing();
  void use_oldest();
  void pass(double interval_s, estimation::UdFilter& filter, estimation::StateVector& state) const;

  ImuRollOptions options_;
  double mount_roll_rad_;
  double limit_rad_;
  double sway_rad_;       // one sigma of the swinging part
  double roll_per_rate_;  // the camera looks down: its roll axis is not the body's
  std::deque<Sample> waiting_;
  estimation::UdFilter filter_;
  estimation::StateVector state_;  // sway, its rate, rate of the track and bias
  int64_t state_ns_ = 0;           // 0 = no sample yet
  int64_t asked_ns_ = 0;
};

}  // namespace railfix::track_detector
