// What can go wrong with a train's sensors, one fault at a time.
#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "core/random.hpp"

namespace railfix::train {

enum class Sensor : uint8_t { none, camera, wheel, accelerometer, gyro, gnss, fix, shape, clock };
enum class FaultKind : uint8_t {
  none,
  bias,
  drift,
  stuck,
  noise,
  outliers,
  dropout,
  blind,
  delay,
  lag,
  stamp_jump,
  wrong_landmark,
  wrong_sighting,
  wrong_branch,
  clock_step
};
std::string to_string(Sensor sensor);
std::string to_string(FaultKind kind);

/// size: of a bias or the end of a drift in the sensor's own unit (share of the way for camera and wheel, m/s^2, rad/s,
/// m for GNSS, fixes and the place of curves, 1/m for the drift of a seen shape; of a wrong sighting, surely known and
/// sharp as ever, one and every second one while it lasts); seconds for delay (it comes so late), lag (its stamp is so
/// late, below 0: early), stamp_jump (the same from its begin on) and clock_step; rate for clock drift; how many times
/// noise; else unused.
struct Fault {
  Sensor sensor = Sensor::none;
  FaultKind kind = FaultKind::none;
  double begin_s = 0;
  double end_s = 0;
  double size = 0;

  [[nodiscard]] bool is(Sensor which, FaultKind what) const { return sensor == which && kind == what; }
  [[nodiscard]] bool active(double t_s) const { return t_s >= begin_s && t_s < end_s; }
  /// Of a drift: 0 at its begin, 1 at its end and after it.
  [[nodiscard]] double progress(double t_s) const;
};

/// Every sensor with every fault that it can have.
const std::vector<std::pair<Sensor, FaultKind>>& all_faults();
/// Sizes from hardly visible to absurd; begins behind 40 s of a run of this duration.
Fault random_fault(core::Random& random, Sensor sensor, FaultKind kind, double duration_s);

}  // namespace railfix::train
