// How one axis of a car body shakes at 20 m/s: some waves of random phase, the slower the larger.
#pragma once

#include <cmath>
#include <vector>

#include "core/random.hpp"
#include "core/units.hpp"

namespace railfix::simulator {

constexpr double kShakeSpeedMps = 20.0;  // it grows with speed

struct ShakeWave {
  double rate_rps, phase_rad, amplitude;
};

class ShakeWaves {
 public:
  ShakeWaves() = default;
  /// The squares of all amplitudes add up to the variance of this sigma, in whatever unit.
  ShakeWaves(double sigma, core::Random& random) {
    double power = 0.0;
    for (int i = 0; i < kWaves; ++i) {
      const double hz = kSlowestHz * std::pow(kFastestHz / kSlowestHz, (i + random.uniform()) / kWaves);
      waves_.push_back({2.0 * core::kPi * hz, random.uniform(0.0, 2.0 * core::kPi), 1.0 / hz});
      power += 0.5 * waves_.back().amplitude * waves_.back().amplitude;
    }
    for (auto& wave : waves_) wave.amplitude *= sigma / std::sqrt(power);
  }
  [[nodiscard]] double at(double time_s, double speed_mps) const {
    const double envelope = speed_mps / kShakeSpeedMps;
    double sum = 0.0;
    for (const auto& wave : waves_)
      sum += envelope * wave.amplitude * std::sin(wave.rate_rps * time_s + wave.phase_rad);
    return sum;
  }

 private:
  static constexpr int kWaves = 8;
  static constexpr double kSlowestHz = 0.4;
  static constexpr double kFastestHz = 6.0;
  std::vector<ShakeWave> waves_;
};

}  // namespace railfix::simulator
