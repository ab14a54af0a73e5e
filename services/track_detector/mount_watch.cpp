#include "track_detector/mount_watch.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace railfix::track_detector {
namespace {

constexpr double kAverageS = 60.0;
constexpr double kLongestIntervalS = 1.0;
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

void MountWatch::add(const TrackShape& shape, double interval_s) {
  interval_s = std::clamp(interval_s, 0.0, kLongestIntervalS);
  seen_s_ += interval_s;
  const double weight = interval_s / std::clamp(seen_s_, 1e-9, kAverageS);
  average_ += weight * (to_vector(shape).head<5>() - mount_ - average_);
}

std::string MountWatch::what_drifted() const {
  if (seen_s_ <= kAverageS / 2) return {};
  std::string what;
  for (int i = 0; i < average_.size(); ++i) {
    const Watched& one = kWatched[i];
    const double limit = one.too_far * sigma_[i];
    if (std::abs(average_[i]) <= limit) continue;
    char text[80];
    std::snprintf(text, sizeof text, "%s%s by %+.2f %s (%.2f may be)", what.empty() ? "" : ", ", one.name,
                  average_[i] * one.scale, one.unit, limit * one.scale);
    what += text;
  }
  return what;
}

}  // namespace railfix::track_detector
