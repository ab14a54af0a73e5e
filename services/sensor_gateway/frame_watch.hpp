// Whether a line breaks what goes over it. Knows no clock.
#pragma once

#include <cstdint>
#include <deque>
#include <string>

#include "sensor_gateway/live_sensor.hpp"

namespace railfix::sensor_gateway {

class FrameWatch {
 public:
  /// On a clock that never jumps.
  void add(const Frames& frames, int64_t now_ns);
  /// Empty while the line is good enough; otherwise behind "receiver ...": how bad it is, and what to do.
  [[nodiscard]] std::string trouble(int64_t now_ns);

 private:
  void forget_before(int64_t ns);
  struct Part {
    int64_t ns;
    Frames frames;
  };
  std::deque<Part> parts_;
  Frames sum_;  // of the parts
};

}  // namespace railfix::sensor_gateway
