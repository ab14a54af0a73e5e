// Where one odometer alone measures, an accelerometer may feel what that does not say: the train starts with a stuck
// wheel or a stuck camera, or brakes on a sliding wheel. Done gently no sample contradicts, and the accelerometer's
// bias learns it little by little. But the speed that it adds up over the last seconds is not the odometer's: from
// there on it is believed beside that.
#pragma once

#include <optional>

namespace railfix::fusion {

/// One acceleration, and what the filter knows by the odometer.
struct FeltInput {
  double dt_s = 0;        // since the one before
  double accel_mps2 = 0;  // with the bias in it
  double accel_sigma_mps2 = 0;
  double bias_mps2 = 0;
  double bias_sigma_mps2 = 0;
  double speed_mps = 0;
  double speed_sigma_mps = 0;
};

/// A plain value.
class FeltMotion {
 public:
  void add(const FeltInput& input);
  /// No odometer says how fast the train runs for now.
  void pause() { last_mps_.reset(); }
  /// The train is felt to run so much faster than the odometer says; 0 = as fast.
  [[nodiscard]] double faster_mps() const { return bias_mps2_ ? lean_mps_ : 0.0; }

 private:
  std::optional<double> last_mps_;
  double lean_mps_ = 0;  // felt less counted change of speed: of the last seconds, or since they came apart
  double variance_ = 0;  // of the accelerometer's noise in it
  double calm_bias_mps2_ = 0;
  std::optional<double> bias_mps2_;  // before they came apart
};

}  // namespace railfix::fusion
