// The sensor tables of a dataset as one stream in the order of time. Knows no clock.
#pragma once

#include <functional>
#include <optional>

#include "dataset/dataset.hpp"

namespace railfix::sensor_gateway {

struct Sinks {
  std::function<void(const dataset::ImuRow&)> imu;
  std::function<void(const dataset::WheelRow&)> wheel;
  std::function<void(const dataset::GnssRow&)> gnss;
};

class Playback {
 public:
  explicit Playback(dataset::Sensors sensors) : sensors_(std::move(sensors)) {}
  /// Gives everything with stamp <= data_ns that was not given yet, oldest first; equal stamps in the order IMU, wheel,
  /// GNSS.
  void play_until(int64_t data_ns, const Sinks& sinks);
  /// Goes on, or back, to here: everything before data_ns is left out.
  void go_to(int64_t data_ns);
  /// Stamp of the next sample; nothing at the end.
  [[nodiscard]] std::optional<int64_t> next_ns() const;
  [[nodiscard]] const dataset::Sensors& sensors() const { return sensors_; }

 private:
  dataset::Sensors sensors_;
  size_t imu_ = 0;
  size_t wheel_ = 0;
  size_t gnss_ = 0;
};

}  // namespace railfix::sensor_gateway
