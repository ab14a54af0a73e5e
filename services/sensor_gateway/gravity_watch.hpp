// Whether an IMU sits as it is said to: over many seconds a train stands upright and gravity is all that is left. Knows
// no clock.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>

#include "dataset/dataset.hpp"

namespace railfix::sensor_gateway {

class GravityWatch {
 public:
  void add(const dataset::ImuRow& row);
  /// Empty while up is up or it is not known yet; otherwise what is wrong and what to do. Its samples are then no
  /// motion of the train: of a live IMU they are not used.
  [[nodiscard]] std::string trouble() const;
  /// Up is up as far as a second tells, which is enough for another axis or unit. Before, and while trouble() is
  /// looked for, its samples are not known to be the train's.
  [[nodiscard]] bool agrees() const { return agrees_; }
  /// trouble() of a recording, whose samples are played as they are.
  [[nodiscard]] std::string trouble_of_recording() const;

 private:
  [[nodiscard]] std::string cause() const;
  [[nodiscard]] std::string cause_of_mean() const;
  std::array<double, 3> mean_mps2_{};  // forward, left, up
  bool agrees_ = false;
  bool told_by_mean_ = false;  // it is that of so long that it says how the IMU sits
  std::string before_;         // cause of the mean before the last gap: no gap turns an IMU round
  std::optional<int64_t> since_ns_;
  int64_t last_ns_ = 0;
};

}  // namespace railfix::sensor_gateway
