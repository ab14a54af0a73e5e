#include "track_detector/mount_watch.hpp"

#include <algorithm>

namespace railfix::track_detector {
namespace {

constexpr double kAverageS = 60.0;
constexpr double kLongestIntervalS = 1.0;
constexpr double kTooFar = 1.5;  // sigmas

}  // namespace

MountWatch::MountWatch(const TrackShape& mount, const TrackShapeSigma& limits)
    : mount_(to_vector(mount).head<5>()), sigma_(to_vector(limits).head<5>()) {}

void MountWatch::add(const TrackShape& shape, double interval_s) {
  interval_s = std::clamp(interval_s, 0.0, kLongestIntervalS);
  seen_s_ += interval_s;
  const double weight = interval_s / std::clamp(seen_s_, 1e-9, kAverageS);
  average_ += weight * (to_vector(shape).head<5>() - mount_ - average_);
}

bool MountWatch::drifted() const {
  return seen_s_ > kAverageS / 2 && (average_.cwiseAbs().array() > kTooFar * sigma_.array()).any();
}

}  // namespace railfix::track_detector
