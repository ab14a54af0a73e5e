// Has the train's acceleration changed from one moment to the next? An emergency brake, a stop: no filter of ordinary
// driving believes it, so that every sensor seems to contradict at once, and it is the filter that is wrong. A sensor
// that is refused and that such a change would explain calls; when a second one calls for the same direction, or when
// it is an odometer and no other sensor has agreed for 0.3 s, it is right.
#pragma once

#include <array>
#include <cstdint>

#include "fusion/fusion_types.hpp"

namespace railfix::fusion {

/// A plain value. Knows camera, wheel and IMU; stamps in their order.
class SuddenChange {
 public:
  static constexpr double kSigmaMps2 = 1.2;  // within the filter's gate of 5 sigma: up to 6 m/s2

  /// A measurement of the sensor was used as it is.
  void agreed(Source source, int64_t stamp_ns) { sensor(source).agreed_ns = stamp_ns; }
  /// A sudden change would explain the sensor's refused measurement, forward (speed grew) or backward. True: believe
  /// it.
  bool called(Source source, int64_t stamp_ns, bool forward);
  /// How long ago the change may have begun.
  [[nodiscard]] double since_s(int64_t stamp_ns) const;

 private:
  static constexpr size_t kSensors = 3;
  struct Sensor {
    int64_t agreed_ns = 0;
    int64_t called_ns = 0;
    bool forward = false;
  };
  Sensor& sensor(Source source) { return sensors_[static_cast<size_t>(source)]; }
  std::array<Sensor, kSensors> sensors_;
};

}  // namespace railfix::fusion
