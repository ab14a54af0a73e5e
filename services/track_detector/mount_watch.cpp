#include "track_detector/mount_watch.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace railfix::track_detector {
namespace {

constexpr double kAverageS = 60.0;
constexpr double kLongestIntervalS = 1.0;
// A camera ahead of the bogies is turned against a curved track, by overhang / radius.
constexpr double kStraightPerM = 3e-4;  // and within two sigmas of zero
constexpr double kOverhangM = 15;
constexpr int kYaw = 2;
// In sigmas of the limits. Pitch and yaw average out over a minute; load and worn rails move the others for good.
struct Watched {
  const char* name;
  double too_far;
  double scale;
  const char* unit;
};
constexpr double kDegPerRad = 57.29577951308232;
constexpr Watched kWatched[] = {{"roll", 1.5, kDegPerRad, "deg"},
                                {"pitch", 0.8, kDegPerRad, "deg"},
                                {"yaw", 0.32, kDegPerRad, "deg"},
                                {"lateral", 1.5, 1, "m"},
                                {"height", 1.5, 1, "m"}};

}  // namespace

MountWatch::MountWatch(const TrackShape& mount, const TrackShapeSigma& limits)
    : mount_(to_vector(mount).head<5>()), sigma_(to_vector(limits).head<5>()) {}

void MountWatch::add(const TrackShape& shape, double curvature_sigma_per_m, double interval_s) {
  if (!(std::abs(shape.curvature_per_m) <= std::max(kStraightPerM, 2 * curvature_sigma_per_m))) return;
  interval_s = std::clamp(interval_s, 0.0, kLongestIntervalS);
  seen_s_ += interval_s;
  const double weight = interval_s / std::clamp(seen_s_, 1e-9, kAverageS);
  average_ += weight * (to_vector(shape).head<5>() - mount_ - average_);
  curvature_per_m_ += weight * (shape.curvature_per_m - curvature_per_m_);
}

std::string MountWatch::what_drifted() const {
  if (seen_s_ <= kAverageS / 2) return {};
  std::string what;
  for (int i = 0; i < average_.size(); ++i) {
    const Watched& one = kWatched[i];
    double limit = one.too_far * sigma_[i];
    if (i == kYaw) limit += kOverhangM * std::max(0.0, std::abs(curvature_per_m_) - kStraightPerM);
    if (std::abs(average_[i]) <= limit) continue;
    char text[80];
    std::snprintf(text, sizeof text, "%s%s by %+.2f %s (%.2f may be)", what.empty() ? "" : ", ", one.name,
                  average_[i] * one.scale, one.unit, limit * one.scale);
    what += text;
  }
  return what;
}

}  // namespace railfix::track_detector
