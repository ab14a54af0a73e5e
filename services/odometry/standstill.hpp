// Standing still adds up to nothing, leaving late costs nothing.
//
// Measured distance against a key frame trembles, by tenths of a millimetre or, with a vibrating camera, by
// millimetres. While it stays in a band about the place of rest the reported distance is held; as soon as it has left
// the band it is reported as measured, with all that was held back.
#pragma once

#include <cstdint>

#include "odometry/recent_places.hpp"

namespace railfix::odometry {

class Standstill {
 public:
  /// hold_m: motion at rest that is not counted until it exceeds it.
  explicit Standstill(double hold_m) : hold_m_(hold_m) {}

  /// Measured distance in the order of stamps -> distance to report.
  double report(int64_t stamp_ns, double measured_m);
  [[nodiscard]] bool resting() const { return resting_; }
  /// Speed over the last fifth of a second; finer than from picture to picture.
  [[nodiscard]] double recent_speed_mps() const;

 private:
  [[nodiscard]] bool left(double measured_m);
  [[nodiscard]] bool settled(double measured_m);

  double hold_m_;
  bool resting_ = true;  // a run begins at rest until it is seen to move
  double anchor_m_ = 0;
  int outside_ = 0;  // pictures in a row
  RecentPlaces recent_;
};

}  // namespace railfix::odometry
