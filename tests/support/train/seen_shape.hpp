// Curvature as pictures tell it, with its errors and faults.
#pragma once

#include <optional>

#include "core/random.hpp"
#include "support/train/simulation.hpp"

namespace railfix::train {

class SeenShape {
 public:
  static constexpr double kSigmaPerM = 1.4e-4;  // as it is said

  /// REQUIRES: both outlive this.
  SeenShape(const TrainSimulation& simulation, core::Random& random);

  /// Of a place, from another one behind it; nothing where it is not seen.
  std::optional<double> look(double from_m, double at_m, double arrival_s);
  [[nodiscard]] double bias_per_m() const { return bias_per_m_; }

 private:
  const TrainSimulation& simulation_;
  core::Random& random_;
  double bias_per_m_;
  double wander_per_m_ = 0;
  double looked_m_ = 0;
  std::optional<double> stuck_per_m_;
};

}  // namespace railfix::train
