#include "track_detector/ground_tracker.hpp"

#include <algorithm>
#include <cmath>

namespace railfix::track_detector {
namespace {

constexpr double kSeenM = 0.25;     // to be seen before and behind the reference distance
constexpr double kSeenShare = 0.6;  // of the pictures meanwhile
constexpr int kMostMissed = 3;
constexpr size_t kFewestUsed = 2;
constexpr int kPasses = 6;
constexpr double kWildSigmas = 2.0;
constexpr double kAgreeShare = 0.5;
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
      // Seen so late it would be settled nowhere else.
      const bool in_time = candidate.ahead_m >= candidate.reference_m + kSeenM;
      owner->reference_m = candidate.reference_m > 0 && in_time ? candidate.reference_m : tracking_.reference_m;
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
  thing.lasting_sigma_m = candidate.lasting_sigma_m;
  thing.hit = true;
  thing.missed = 0;
  ++thing.seen;
  const double clearness = 1 / (candidate.ahead_m * candidate.ahead_m);
  thing.clearness += clearness;
  thing.score += clearness * candidate.score;
  if (std::abs(candidate.ahead_m - thing.reference_m) > tracking_.reach_m) return;
  // Near the reference a place counts most: the way to there is short.
  const double way_sigma_m = 2 * way_sigma_ * std::abs(candidate.ahead_m - thing.reference_m);
  const double spot_sigma_m = tracking_.spot_sigma_m + kSpotPerM * candidate.ahead_m;
  const double weight = 1 / (way_sigma_m * way_sigma_m + spot_sigma_m * spot_sigma_m);
  if (thing.used == kMostLooks) {  // a slow train: every second one is enough
    for (size_t i = 0; 2 * i < kMostLooks; ++i) thing.looks[i] = thing.looks[2 * i + 1];
    thing.used = kMostLooks / 2;
  }
  thing.looks[thing.used++] = {way_m + candidate.ahead_m - thing.first_m, candidate.lateral_m, weight};
}

// Seen on both sides of the reference distance: on half a metre of its way at least, so that a stain on the lens or a
// standing train settles nothing.
std::optional<SettledThing> GroundTracker::settle(const Thing& thing) const {
  if (thing.seen < tracking_.fewest_pictures || thing.used < kFewestUsed) return std::nullopt;
  if (thing.last_ahead_m > thing.reference_m - kSeenM) return std::nullopt;
  if (thing.first_ahead_m < thing.reference_m + kSeenM) return std::nullopt;
  if (thing.seen < kSeenShare * (thing.seen + thing.gaps)) return std::nullopt;
  const Mean mean = mean_of(thing);
  if (mean.rms_m > tracking_.worst_fit_m || mean.agreeing < kAgreeShare * static_cast<double>(thing.used))
    return std::nullopt;
  const double noise_m = std::hypot(tracking_.spot_sigma_m, mean.rms_m) / std::sqrt(mean.agreeing);
  const double sure = confidence(thing);
  if (sure < tracking_.lowest_confidence) return std::nullopt;
  return SettledThing{thing.first_m + mean.place_m, mean.lateral_m, noise_m, sure, thing.reference_m,
                      thing.lasting_sigma_m};
}

// Cauchy weights: a look that took a shadow for an edge does not count.
GroundTracker::Mean GroundTracker::mean_of(const Thing& thing) const {
  Mean mean;
  for (int pass = 0; pass < kPasses; ++pass) {
    double weight = 0, place = 0, lateral = 0, squared = 0, agreeing = 0;
    for (size_t i = 0; i < thing.used; ++i) {
      const Look& look = thing.looks[i];
      const double off_m = look.place_m - mean.place_m;
      const double trust = pass == 0 ? 1.0 : 1 / (1 + std::pow(off_m / (kWildSigmas * tracking_.spot_sigma_m), 2));
      weight += trust * look.weight;
      place += trust * look.weight * look.place_m;
      lateral += trust * look.weight * look.lateral_m;
      squared += trust * look.weight * off_m * off_m;
      agreeing += trust;
    }
    mean = {place / weight, lateral / weight, pass == 0 ? 0.0 : std::sqrt(squared / weight), agreeing};
  }
  return mean;
}

// Looks at one thing see the same: their log odds are averaged, not added.
double GroundTracker::confidence(const Thing& thing) const {
  const double score = thing.score / thing.clearness;
  const double by_score = tracking_.log_odds ? 1 / (1 + std::exp(tracking_.usual_score - score))
                                             : 1 - 0.5 * std::exp(-std::pow(score / tracking_.usual_score, 2));
  return by_score * (1 - std::exp(-tracking_.trust_a_look * thing.seen));
}

}  // namespace railfix::track_detector
