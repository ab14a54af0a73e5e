#include "fusion/felt_motion.hpp"

#include <cmath>
#include <utility>

namespace railfix::fusion {
namespace {

constexpr double kWindowS = 2.0;
constexpr double kApartSigmas = 4.0;
constexpr double kCalmSigmas = 1.0;

}  // namespace

void FeltMotion::add(const FeltInput& input) {
  const double before_mps = std::exchange(last_mps_, input.speed_mps).value_or(input.speed_mps);
  const double bias_mps2 = bias_mps2_.value_or(input.bias_mps2);
  const double kept = bias_mps2_ ? 1.0 : std::exp(-input.dt_s / kWindowS);
  lean_mps_ = kept * lean_mps_ + (input.accel_mps2 - bias_mps2) * input.dt_s - (input.speed_mps - before_mps);
  variance_ = kept * kept * variance_ + std::pow(input.accel_sigma_mps2 * input.dt_s, 2);
  if (bias_mps2_) return;
  const double sigma_mps =
      std::hypot(std::sqrt(variance_), input.bias_sigma_mps2 * kWindowS, std::sqrt(2.0) * input.speed_sigma_mps);
  if (std::abs(lean_mps_) < kCalmSigmas * sigma_mps) calm_bias_mps2_ = input.bias_mps2;
  if (std::abs(lean_mps_) > kApartSigmas * sigma_mps) bias_mps2_ = calm_bias_mps2_;
}

}  // namespace railfix::fusion
