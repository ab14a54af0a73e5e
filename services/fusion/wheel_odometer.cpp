#include "fusion/wheel_odometer.hpp"

#include <cmath>
#include <utility>

namespace railfix::fusion {
namespace {

constexpr double kScatterResolutions = 3.0;

}  // namespace

WheelReading WheelOdometer::read(const WheelInput& sample) {
  WheelReading reading{.is_first = !first_pulses_};
  if (reading.is_first) first_pulses_ = sample.pulses;
  reading.odometer_m = static_cast<double>(sample.pulses - *first_pulses_) / sample.pulses_per_metre;
  if (!reading.is_first) reading.way_m = reading.odometer_m - std::exchange(last_m_, reading.odometer_m);
  noise_.add(sample.stamp_ns, reading.odometer_m);
  const double resolution_sigma_m = std::hypot(1 / sample.pulses_per_metre / std::sqrt(12.0), 0.001);
  const double noise_m = noise_.sigma_m();
  scatters_ = noise_m > kScatterResolutions * resolution_sigma_m;
  reading.sigma_m = scatters_ ? noise_m : resolution_sigma_m;
  resolution_m_ = scatters_ ? noise_m * std::sqrt(2.0) : 1 / sample.pulses_per_metre;
  return reading;
}

void WheelOdometer::go_on_from(const WheelOdometer& other) {
  first_pulses_ = other.first_pulses_;
  last_m_ = other.last_m_;
  resolution_m_ = other.resolution_m_;
  scatters_ = other.scatters_;
}

}  // namespace railfix::fusion
