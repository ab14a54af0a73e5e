#include "sensor_gateway/gravity_watch.hpp"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <cmath>

#include "core/time.hpp"

namespace railfix::sensor_gateway {
namespace {

constexpr double kMeanS = 10;
constexpr double kAgreesAfterS = 1;
constexpr double kLongestGapS = 1;
// Cant, gradient, braking and a crooked bracket together tilt the mean by less than 30 degrees.
constexpr double kLeastUp = 0.866;
constexpr double kFreeFallMps2 = 0.3;  // less than this is no gravity at all
constexpr double kLeastMps2 = 8;       // less and more are other units
constexpr double kMostMps2 = 12;

}  // namespace

void GravityWatch::add(const dataset::ImuRow& row) {
  const double gap_s = core::seconds(row.stamp_ns - last_ns_);
  last_ns_ = row.stamp_ns;
  if (!since_ns_ || gap_s < 0 || gap_s > kLongestGapS) {
    if (told_by_mean_) before_ = cause();
    agrees_ = told_by_mean_ = false;
    since_ns_ = row.stamp_ns;
    std::copy(std::begin(row.accel_mps2), std::end(row.accel_mps2), mean_mps2_.begin());
    return;
  }
  const double age_s = core::seconds(row.stamp_ns - *since_ns_);
  told_by_mean_ = age_s >= kMeanS;
  // At first that of all samples: the very first one may be a shock.
  const double share = std::max(1 - std::exp(-gap_s / kMeanS), gap_s / (age_s + gap_s));
  for (size_t i = 0; i < 3; ++i) mean_mps2_[i] += share * (row.accel_mps2[i] - mean_mps2_[i]);
  agrees_ = agrees_ || (age_s >= kAgreesAfterS && cause_of_mean().empty());
}

std::string GravityWatch::cause() const {
  return told_by_mean_ ? cause_of_mean() : before_;
}

std::string GravityWatch::cause_of_mean() const {
  const double whole_mps2 = std::hypot(mean_mps2_[0], mean_mps2_[1], mean_mps2_[2]);
  if (whole_mps2 < kFreeFallMps2) return "the IMU feels no gravity; it is broken or of another kind";
  if (whole_mps2 < kLeastMps2 || whole_mps2 > kMostMps2)
    return fmt::format("the IMU feels gravity as {:.1f} and not as 9.8 m/s2; it is broken or counts in other units",
                       whole_mps2);
  if (mean_mps2_[2] > kLeastUp * whole_mps2) return "";
  constexpr const char* kNames[] = {"forward", "left", "up"};
  const auto* const most = std::max_element(mean_mps2_.begin(), mean_mps2_.end(),
                                            [](double a, double b) { return std::abs(a) < std::abs(b); });
  const std::string name = kNames[most - mean_mps2_.begin()];
  return "the IMU's axis that points up is called " + name + (*most < 0 ? ", the other way round" : "");
}

std::string GravityWatch::trouble() const {
  const std::string why = cause();
  return why.empty() ? "" : why + ", so its samples are not used; correct live.imu_axes, or the IMU";
}

std::string GravityWatch::trouble_of_recording() const {
  const std::string why = cause();
  return why.empty() ? "" : why + "; the recording's IMU must have x forward, y left, z up, rad/s and m/s2";
}

}  // namespace railfix::sensor_gateway
