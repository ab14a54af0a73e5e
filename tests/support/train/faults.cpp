#include "support/train/faults.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace railfix::train {
namespace {

struct Range {
  double least;
  double most;
};

// Even over the orders of magnitude, either sign.
double between(core::Random& random, Range range) {
  const double size = range.least * std::pow(range.most / range.least, random.uniform());
  return random.uniform() < 0.5 ? -size : size;
}

Range bias_range(Sensor sensor) {
  switch (sensor) {
    case Sensor::camera:
      return {0.005, 0.08};  // the mount is knocked
    case Sensor::wheel:
      return {0.005, 0.5};  // slip and slide
    case Sensor::accelerometer:
      return {0.05, 3};
    case Sensor::gyro:
      return {0.002, 0.3};
    case Sensor::gnss:
      return {5, 500};
    case Sensor::shape:
      return {1, 10};  // the curve was laid anew, or drawn roughly
    default:
      return {0.1, 0.8};  // of a place: the mount's pitch, the map; more is a wrong landmark
  }
}

Range drift_range(Sensor sensor) {
  switch (sensor) {
    case Sensor::gnss:
      return {3, 60};  // slow: multipath; faster ones are seen as a bias is
    case Sensor::clock:
      return {1e-5, 1e-3};
    case Sensor::shape:
      return {3e-5, 1e-3};  // of the curvature: the mount turns
    default:
      return bias_range(sensor);
  }
}

double random_size(core::Random& random, Sensor sensor, FaultKind kind) {
  switch (kind) {
    case FaultKind::bias:
      return between(random, bias_range(sensor));
    case FaultKind::drift:
      return between(random, drift_range(sensor));
    case FaultKind::noise:
      return 10;
    case FaultKind::delay:
      return std::abs(between(random, {0.05, 2.5}));
    case FaultKind::lag:
      return sensor == Sensor::gnss ? std::abs(between(random, {0.1, 1.5})) : between(random, {0.02, 0.3});
    case FaultKind::stamp_jump:
      return between(random, {0.03, 0.3});
    case FaultKind::wrong_landmark:
      return between(random, {1, 400});
    case FaultKind::wrong_sighting:
      return between(random, {1, 3});
    case FaultKind::clock_step:
      return between(random, {0.01, 100});
    default:
      return 1;
  }
}

}  // namespace

std::string to_string(Sensor sensor) {
  static const std::array names{"none", "camera", "wheel", "accelerometer", "gyro", "gnss", "fix", "shape", "clock"};
  return names.at(static_cast<size_t>(sensor));
}

std::string to_string(FaultKind kind) {
  static const std::array names{"none",       "bias",           "drift",          "stuck",        "noise",
                                "outliers",   "dropout",        "blind",          "delay",        "lag",
                                "stamp jump", "wrong landmark", "wrong sighting", "wrong branch", "clock step"};
  return names.at(static_cast<size_t>(kind));
}

double Fault::progress(double t_s) const {
  return std::clamp((t_s - begin_s) / std::max(end_s - begin_s, 1e-9), 0.0, 1.0);
}

const std::vector<std::pair<Sensor, FaultKind>>& all_faults() {
  static const auto list = [] {
    std::vector<std::pair<Sensor, FaultKind>> all{{Sensor::none, FaultKind::none}};
    for (const auto sensor : {Sensor::camera, Sensor::wheel, Sensor::accelerometer, Sensor::gyro, Sensor::gnss,
                              Sensor::fix, Sensor::shape}) {
      for (const auto kind : {FaultKind::bias, FaultKind::drift, FaultKind::stuck, FaultKind::noise,
                              FaultKind::outliers, FaultKind::dropout, FaultKind::delay})
        all.emplace_back(sensor, kind);
    }
    all.emplace_back(Sensor::camera, FaultKind::blind);
    all.emplace_back(Sensor::fix, FaultKind::wrong_landmark);
    all.emplace_back(Sensor::fix, FaultKind::wrong_branch);
    all.emplace_back(Sensor::clock, FaultKind::clock_step);
    all.emplace_back(Sensor::clock, FaultKind::drift);
    all.emplace_back(Sensor::fix, FaultKind::wrong_sighting);
    for (const auto sensor : {Sensor::gnss, Sensor::camera, Sensor::wheel, Sensor::accelerometer})
      all.emplace_back(sensor, FaultKind::lag);
    all.emplace_back(Sensor::camera, FaultKind::stamp_jump);
    return all;
  }();
  return list;
}

Fault random_fault(core::Random& random, Sensor sensor, FaultKind kind, double duration_s) {
  Fault fault{sensor, kind, 0, 0, random_size(random, sensor, kind)};
  fault.begin_s = random.uniform(40, std::max(41.0, 0.7 * duration_s));
  fault.end_s = fault.begin_s + random.uniform(5, 90);
  // A bias of a mount or a map stays; so does what a drift has come to.
  const bool slow = kind == FaultKind::drift || sensor == Sensor::clock;
  if (slow) fault.end_s = fault.begin_s + random.uniform(30, 90);
  if (kind == FaultKind::bias && random.uniform() < 0.5) fault.end_s = duration_s + 1;
  return fault;
}

}  // namespace railfix::train
