#include "sensor_gateway/gravity_watch.hpp"

#include <algorithm>
#include <cmath>

#include "core/time.hpp"

namespace railfix::sensor_gateway {
namespace {

constexpr double kMeanS = 10;
constexpr double kLongestGapS = 1;
// Cant, gradient, braking and a crooked bracket together tilt the mean by less than 30 degrees.
constexpr double kLeastUp = 0.866;
constexpr double kFreeFallMps2 = 3;  // less than this is no gravity at all

}  // namespace

void GravityWatch::add(const dataset::ImuRow& row) {
  const double gap_s = core::seconds(row.stamp_ns - last_ns_);
  last_ns_ = row.stamp_ns;
  if (!since_ns_ || gap_s < 0 || gap_s > kLongestGapS) {
    since_ns_ = row.stamp_ns;
    std::copy(std::begin(row.accel_mps2), std::end(row.accel_mps2), mean_mps2_.begin());
    return;
  }
  const double share = 1 - std::exp(-gap_s / kMeanS);
  for (size_t i = 0; i < 3; ++i) mean_mps2_[i] += share * (row.accel_mps2[i] - mean_mps2_[i]);
}

std::string GravityWatch::trouble() const {
  if (!since_ns_ || core::seconds(last_ns_ - *since_ns_) < kMeanS) return "";
  const double whole_mps2 = std::hypot(mean_mps2_[0], mean_mps2_[1], mean_mps2_[2]);
  if (whole_mps2 < kFreeFallMps2)
    return "the IMU feels no gravity, so its samples are not used; it is broken or of another kind";
  if (mean_mps2_[2] > kLeastUp * whole_mps2) return "";
  constexpr const char* kNames[] = {"forward", "left", "up"};
  const auto* const most = std::max_element(mean_mps2_.begin(), mean_mps2_.end(),
                                            [](double a, double b) { return std::abs(a) < std::abs(b); });
  const std::string name = kNames[most - mean_mps2_.begin()];
  return "the IMU's axis that points up is the one that live.imu_axes calls " + name +
         (*most < 0 ? ", the other way round" : "") + ", so its samples are not used; correct live.imu_axes";
}

}  // namespace railfix::sensor_gateway
