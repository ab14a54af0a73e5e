#include "track_detector/ground_tracker.hpp"

#include <algorithm>
#include <cmath>

namespace railfix::track_detector {
namespace {

constexpr double kSeenM = 0.25;     // to be seen before and behind the reference distance
constexpr double kSeenShare = 0.6;  // of the pictures meanwhile
constexpr int kMostMissed = 3;
constexpr int kFewestUsed = 2;
constexpr double kSpotPerM = 0.0015;  // spots are less sharp farther away

constexpr size_t kUsuallyFollowed = 64;

}  // namespace

GroundTracker::GroundTracker(const GroundTracking& tracking, double way_sigma)
    : tracking_(tracking), way_sigma_(way_sigma) {
  things_.reserve(kUsuallyFollowed);
  settled_.reserve(kUsuallyFollowed);
}

const std::vector<SettledThing>& GroundTracker::follow(const std::vector<GroundCandidate>& found, double way_m) {
  settled_.clear();
  for (Thing& thing : things_) thing.hit = false;
  for (const GroundCandidate& candidate : found) {
    Thing* owner = nullptr;
    double nearest_m = tracking_.follow_m;
    for (Thing& thing : things_) {
      const double off_m = std::abs(way_m + candidate.ahead_m - thing.last_m);
      if (thing.hit || std::abs(candidate.lateral_m - thing.last_lateral_m) > tracking_.sideways_m) continue;
      if (off_m < nearest_m + kSpotPerM * candidate.ahead_m * candidate.ahead_m) {
        nearest_m = off_m;
        owner = &thing;
      }
    }
    if (owner == nullptr) {
      things_.emplace_back();
      owner = &things_.back();
      owner->first_m = way_m + candidate.ahead_m;
      owner->first_ahead_m = candidate.ahead_m;
    }
    add(*owner, candidate, way_m);
  }
  for (Thing& thing : things_) {
    if (!thing.hit) {
      ++thing.missed;
      ++thing.gaps;
    } else if (const auto settled = thing.settled ? std::nullopt : settle(thing)) {
      thing.settled = true;
      settled_.push_back(*settled);
    }
  }
  std::erase_if(things_, [](const Thing& thing) { return thing.missed > kMostMissed; });
  return settled_;
}

void GroundTracker::add(Thing& thing, const GroundCandidate& candidate, double way_m) const {
  thing.last_m = way_m + candidate.ahead_m;
  thing.last_ahead_m = candidate.ahead_m;
  thing.last_lateral_m = candidate.lateral_m;
  thing.hit = true;
  thing.missed = 0;
  ++thing.seen;
  if (std::abs(candidate.ahead_m - tracking_.reference_m) > tracking_.reach_m) return;
  // Near the reference a place counts most: the way to there is short.
  const double way_sigma_m = 2 * way_sigma_ * std::abs(candidate.ahead_m - tracking_.reference_m);
  const double spot_sigma_m = tracking_.spot_sigma_m + kSpotPerM * candidate.ahead_m;
  const double weight = 1 / (way_sigma_m * way_sigma_m + spot_sigma_m * spot_sigma_m);
  const double place_m = way_m + candidate.ahead_m - thing.first_m;
  thing.weight += weight;
  thing.place += weight * place_m;
  thing.squared += weight * place_m * place_m;
  thing.lateral += weight * candidate.lateral_m;
  thing.score += weight * candidate.score;
  ++thing.used;
}

// Seen on both sides of the reference distance: on half a metre of its way at least, so that a stain on the lens or a
// standing train settles nothing.
std::optional<SettledThing> GroundTracker::settle(const Thing& thing) const {
  if (thing.seen < tracking_.fewest_pictures || thing.used < kFewestUsed) return std::nullopt;
  if (thing.last_ahead_m > tracking_.reference_m - kSeenM) return std::nullopt;
  if (thing.first_ahead_m < tracking_.reference_m + kSeenM) return std::nullopt;
  if (thing.seen < kSeenShare * (thing.seen + thing.gaps)) return std::nullopt;
  const double mean = thing.place / thing.weight;
  const double rms_m = std::sqrt(std::max(0.0, thing.squared / thing.weight - mean * mean));
  if (rms_m > tracking_.worst_fit_m) return std::nullopt;
  const double noise_m = std::hypot(tracking_.spot_sigma_m, rms_m) / std::sqrt(static_cast<double>(thing.used));
  const double by_score = 1 - std::exp(-thing.score / thing.weight / tracking_.usual_score);
  const double confidence = (1 - std::exp(-0.5 * thing.seen)) * (0.5 + 0.5 * by_score);
  if (confidence < tracking_.lowest_confidence) return std::nullopt;
  return SettledThing{thing.first_m + mean, thing.lateral / thing.weight, noise_m, confidence};
}

}  // namespace railfix::track_detector
