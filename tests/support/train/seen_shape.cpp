#include "support/train/seen_shape.hpp"

#include <cmath>

namespace railfix::train {
namespace {

// 9e-5 1/m rms where a sigma of 1.4e-4 is said, over 26 km at 8 degrees.
constexpr double kWhitePerM = 7e-5;
constexpr double kWanderPerM = 5e-5;
constexpr double kWanderLengthM = 20;
constexpr double kBiasPerM = 2e-5;
constexpr double kOutlierPerM = 2e-3;

}  // namespace

SeenShape::SeenShape(const TrainSimulation& simulation, core::Random& random)
    : simulation_(simulation), random_(random), bias_per_m_(kBiasPerM * random.normal()) {}

std::optional<double> SeenShape::look(double from_m, double at_m, double arrival_s) {
  const auto& fault = simulation_.plan().fault;
  const bool faulty = fault.sensor == Sensor::shape && fault.active(arrival_s);
  const double way_m = std::abs(from_m - looked_m_);
  looked_m_ = from_m;
  const double keep = std::exp(-way_m / kWanderLengthM);
  wander_per_m_ = keep * wander_per_m_ + std::sqrt(1 - keep * keep) * kWanderPerM * random_.normal();
  const double times = faulty && fault.kind == FaultKind::noise ? fault.size : 1;
  double seen_per_m =
      simulation_.curvature_at(at_m, arrival_s) + bias_per_m_ + times * (wander_per_m_ + kWhitePerM * random_.normal());
  const bool wild = random_.uniform() < 0.3;
  if (fault.is(Sensor::shape, FaultKind::drift)) seen_per_m += fault.size * fault.progress(arrival_s);
  if (faulty && fault.kind == FaultKind::outliers && wild) seen_per_m += kOutlierPerM;
  if (faulty && fault.kind == FaultKind::stuck) seen_per_m = *(stuck_per_m_ = stuck_per_m_.value_or(seen_per_m));
  if (!simulation_.sees(arrival_s) || (faulty && fault.kind == FaultKind::dropout)) return std::nullopt;
  return seen_per_m;
}

}  // namespace railfix::train
