// The wheel's odometer: from pulses to metres, and how sure a reading is.
#pragma once

#include <cstdint>
#include <optional>

#include "fusion/fusion_types.hpp"
#include "fusion/wheel_noise.hpp"

namespace railfix::fusion {

struct WheelReading {
  bool is_first = false;
  double odometer_m = 0;  // since the first one
  double way_m = 0;       // since the one before
  double sigma_m = 0;
};

/// A plain value. Feed it every sample in the order of the stamps.
class WheelOdometer {
 public:
  WheelReading read(const WheelInput& sample);
  /// The last readings scatter by more than a pulse does.
  [[nodiscard]] bool scatters() const { return scatters_; }
  /// What the way between two readings is uncertain by, from these alone.
  [[nodiscard]] double resolution_m() const { return resolution_m_; }
  /// The other one has read on where this one had no samples. How they scatter it has to find itself.
  void go_on_from(const WheelOdometer& other);

 private:
  std::optional<int64_t> first_pulses_;
  double last_m_ = 0;
  double resolution_m_ = 0;
  bool scatters_ = false;
  WheelNoise noise_;
};

}  // namespace railfix::fusion
