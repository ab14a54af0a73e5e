// Which of the sensors of a source that delivers is silent. Knows no clock.
#pragma once

#include <array>
#include <cstdint>
#include <set>
#include <string>
#include <variant>

#include "sensor_gateway/live_sensor.hpp"

namespace railfix::sensor_gateway {

class SensorSilence {
 public:
  /// Of each sensor in the order of Sample; empty = there is none.
  using Sources = std::array<std::string, std::variant_size_v<Sample>>;
  SensorSilence() = default;
  /// All times are of a clock that never jumps.
  SensorSilence(Sources sources, double silent_s, int64_t now_ns);
  /// It says itself why, and none of its sensors is silent by itself.
  void gone(const std::string& source) { gone_.insert(source); }
  void heard(size_t sensor, int64_t now_ns);
  /// Nothing for silent_s, while another one of its source delivers.
  [[nodiscard]] bool lacks(size_t sensor, int64_t now_ns) const;

 private:
  Sources sources_;
  double silent_s_ = 0;
  std::array<int64_t, std::variant_size_v<Sample>> heard_ns_{};  // before its first sample, since when it is awaited
  std::set<std::string> gone_;                                   // sources, since their last sample
};

}  // namespace railfix::sensor_gateway
