// How an IMU sits on the train: which of its axes point forward, left and up.
#pragma once

#include <array>
#include <string>

#include "core/result.hpp"
#include "dataset/dataset.hpp"

namespace railfix::sensor_gateway {

class ImuAxes {
 public:
  /// "x y z", "-y x z", ...; an error where that is no way to sit.
  static core::Result<ImuAxes> parse(const std::string& text);
  /// Rates and accelerations of the IMU's axes in those of the train.
  void turn(dataset::ImuRow& row) const;

 private:
  struct Axis {
    size_t index = 0;
    double sign = 1;
  };
  std::array<Axis, 3> axes_;  // forward, left, up
};

}  // namespace railfix::sensor_gateway
