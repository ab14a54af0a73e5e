#include "sensor_gateway/imu_axes.hpp"

#include <sstream>

namespace railfix::sensor_gateway {

core::Result<ImuAxes> ImuAxes::parse(const std::string& text) {
  const core::Error wrong{
      "imu_axes '" + text +
      "' is no way in which an IMU can sit; give its axes that point forward, left and up, as x y z "
      "or -y x z"};
  ImuAxes axes;
  std::istringstream words(text);
  std::string word;
  double turns[3][3] = {};
  for (size_t i = 0; i < 3; ++i) {
    if (!(words >> word)) return wrong;
    const bool against = word.front() == '-';
    const auto index = std::string("xyz").find(word.substr(against ? 1 : 0));
    if (word.size() != (against ? 2U : 1U) || index == std::string::npos) return wrong;
    axes.axes_[i] = {index, against ? -1.0 : 1.0};
    turns[i][index] = axes.axes_[i].sign;
  }
  double determinant = 0;
  for (size_t i = 0; i < 3; ++i) {
    const size_t next = (i + 1) % 3;
    const size_t last = (i + 2) % 3;
    determinant += turns[0][i] * (turns[1][next] * turns[2][last] - turns[1][last] * turns[2][next]);
  }
  if (words >> word || determinant < 0.5) return wrong;  // a mirrored one, or two times the same axis
  return axes;
}

void ImuAxes::turn(dataset::ImuRow& row) const {
  const dataset::ImuRow its = row;
  for (size_t i = 0; i < 3; ++i) {
    row.rate_rps[i] = axes_[i].sign * its.rate_rps[axes_[i].index];
    row.accel_mps2[i] = axes_[i].sign * its.accel_mps2[axes_[i].index];
  }
}

}  // namespace railfix::sensor_gateway
