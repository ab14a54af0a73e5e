#include "map_matcher/landmark_matcher.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "map_matcher/inputs.hpp"

namespace railfix::map_matcher {
namespace {

constexpr double kDensityReachM = 200;  // of mapped landmarks, for the chance of a random hit
constexpr double kFitStepM = 0.7;       // earlier sightings fit within about so much
constexpr double kClearSideM = 1.0;
constexpr double kUsualConfidence = 0.95;  // of the sightings of which false_per_m are false
constexpr double kMovedSigmas = 3.0;       // what is less is not moved
constexpr size_t kMostSightings = 12;
constexpr int kScaleSteps = 4;         // to either side
constexpr double kScaleStep = 0.6;     // sigmas
constexpr double kScaleChanges = 0.3;  // share of the scale's sigma that differs from place to place
constexpr double kOddM = 0.1;
constexpr size_t kMostCandidates = 50;    // are searched in a quarter of a second: a mast comes every second
constexpr double kUnmappedReachM = 5000;  // over which a map lacks landmarks as it does here
constexpr double kConfirmed = 1e-6;       // odds against the place behind three or four landmarks that fit, ...
constexpr double kMostOdds = 1e3;         // ... and so many more bring it back when nothing has
constexpr double kLost = 1.0;  // a place that was confirmed is in doubt again: the map may be wrong in between

double gauss(double error, double sigma) {
  const double z = error / sigma;
  return std::exp(-0.5 * z * z) / (sigma * std::sqrt(2 * std::numbers::pi));
}

bool other_side(double lateral_m, double other_m) {
  return std::abs(lateral_m) > kClearSideM && std::abs(other_m) > kClearSideM && (lateral_m > 0) != (other_m > 0);
}

}  // namespace

void UnmappedRate::learn(double place_m, double probability) {
  const double way_m = std::max(0.0, place_m - last_m_.value_or(place_m));
  const double kept = std::exp(-way_m / kUnmappedReachM);
  count_ = kept * count_ + probability;
  way_m_ = kept * way_m_ + way_m;
  last_m_ = place_m;
}

// The window only selects. An object that was met before says nothing new: what the map has wrong about it is the same
// each time.
std::optional<Fix> LandmarkMatcher::add(const Sighting& sighting, const Prior& prior) {
  if (!prior.usable() || !has_sense(sighting)) return std::nullopt;
  const double place_m = prior.travelled_m + sighting.distance_ahead_m;
  const double margin_m = parameters_.window_margin_m + 3 * sighting.sigma_m;
  const double expected_m = prior.path_distance_m + sighting.distance_ahead_m;
  const Window window{expected_m, expected_m - prior.over_m - margin_m, expected_m + prior.under_m + margin_m};
  std::erase_if(seen_, [&](const Seen& seen) { return std::abs(place_m - seen.place_m) > parameters_.history_m; });
  const bool again = std::erase_if(seen_, [&](const Seen& seen) { return is_of(seen, sighting, place_m); }) > 0;
  std::vector<const track::PathLandmark*> candidates = near(sighting.kind, window.from_m, window.to_m);
  std::erase_if(candidates, [&](const auto* landmark) { return other_side(sighting.lateral_m, landmark->lateral_m); });
  if (candidates.size() > kMostCandidates) {
    remember(sighting, place_m);  // for when the window is smaller, or for those of a rarer kind
    return std::nullopt;
  }
  for (Seen& seen : seen_) seen.unmapped_per_m = unmapped(seen.sighting.kind).per_m();
  const Weights weights = weigh(sighting, place_m, window, candidates);
  if (weights.here > 0 && !again) {
    odds_elsewhere_ = std::clamp(weights.elsewhere / weights.here, std::min(odds_elsewhere_, kConfirmed), kMostOdds);
    unmapped(sighting.kind).learn(place_m, weights.nothing / weights.here);
  }
  confirmed_ = odds_elsewhere_ <= (confirmed_ ? kLost : kConfirmed);
  remember(sighting, place_m);
  const double sum = weights.here + weights.elsewhere;
  const auto* best = weights.best;
  if (best == nullptr || !(weights.of_best >= parameters_.min_probability * sum)) return std::nullopt;
  return Fix{sighting.stamp_ns,
             best->distance_m - sighting.distance_ahead_m,
             std::hypot(sighting.sigma_m, best->landmark->sigma_m),
             weights.of_best / sum,
             best->landmark->id,
             confirmed_ ? SightingsFit::here : SightingsFit::not_told};
}

// Every mapped landmark of the kind in the window is one hypothesis, weighed by how well the earlier sightings fit it;
// that it stands elsewhere than the map says is another; the last one is that this sighting is false, weighed by the
// mean fit over the window. A confidence below the usual is a chance for the sighting, not for each landmark in the
// window. That the train is not in the window at all is weighed by what such a sighting would be by chance; the odds of
// that go on from sighting to sighting.
LandmarkMatcher::Weights LandmarkMatcher::weigh(const Sighting& sighting, double place_m, const Window& window,
                                                const std::vector<const track::PathLandmark*>& candidates) {
  const double length_m = window.to_m - window.from_m;
  const double confidence = std::clamp(sighting.confidence, 0.01, 0.999);
  const double expected = std::max(1.0, parameters_.detection * static_cast<double>(candidates.size()));
  const double doubt = std::max(0.0, kUsualConfidence - confidence);
  const double earlier = mean_fit(window.from_m - place_m, window.to_m - place_m, place_m);
  const double unmapped_per_m = unmapped(sighting.kind).per_m();
  Weights weights;
  weights.nothing = earlier * (doubt * expected + unmapped_per_m * length_m);
  weights.here = weights.nothing;
  for (const auto* landmark : candidates) {
    const double shift_m = landmark->distance_m - place_m;
    const double chance = confidence * parameters_.detection;
    const double weight = chance * (1 - parameters_.moved) * history_fits(shift_m, place_m);
    const double still_m =
        std::min(kMovedSigmas * std::hypot(sighting.sigma_m, landmark->landmark->sigma_m), 0.5 * parameters_.moved_m);
    const double moved = 0.5 * (mean_fit(shift_m - parameters_.moved_m, shift_m - still_m, place_m) +
                                mean_fit(shift_m + still_m, shift_m + parameters_.moved_m, place_m));
    weights.here += weight + chance * parameters_.moved * moved;
    if (weight <= weights.of_best) continue;
    weights.best = landmark;
    weights.of_best = weight;
  }
  const double by_chance_per_m =
      unmapped_per_m + parameters_.detection * mapped_per_m(sighting.kind, window.expected_m);
  weights.elsewhere = odds_elsewhere_ * earlier * length_m * by_chance_per_m;
  return weights;
}

void LandmarkMatcher::remember(const Sighting& sighting, double place_m) {
  seen_.push_back({sighting, place_m});
  if (seen_.size() > kMostSightings) seen_.pop_front();
}

double LandmarkMatcher::mean_fit(double from_m, double to_m, double now_m) const {
  const int steps = std::max(1, static_cast<int>(std::ceil((to_m - from_m) / kFitStepM)));
  double sum = 0;
  for (int i = 0; i < steps; ++i) sum += history_fits(from_m + (to_m - from_m) * (i + 0.5) / steps, now_m);
  return sum / steps;
}

// The odometer's scale is unknown, but the same for all of them.
double LandmarkMatcher::history_fits(double shift_m, double now_m) const {
  if (seen_.empty()) return 1;
  double sum = 0;
  double weights = 0;
  for (int i = -kScaleSteps; i <= kScaleSteps; ++i) {
    const double z = kScaleStep * i;
    const double weight = std::exp(-0.5 * z * z);
    weights += weight;
    sum += weight * history_fits(shift_m, z * parameters_.scale_sigma, now_m);
  }
  return sum / weights;
}

double LandmarkMatcher::history_fits(double shift_m, double scale, double now_m) const {
  double fit = 1;
  for (const auto& seen : seen_) {
    const double path_m = seen.place_m + shift_m - scale * (now_m - seen.place_m);
    fit *= sighting_fits(seen, path_m, now_m);
  }
  // Landmarks between the sightings that nobody reported.
  const auto [first, last] = std::minmax(seen_.front().place_m, now_m);
  const double reach_m = 1 + std::abs(scale) * (last - first);
  for (const auto& landmark : path_->landmarks_between(first + shift_m - reach_m, last + shift_m + reach_m)) {
    const double nearly_m = landmark.distance_m - shift_m;
    const double place_m = nearly_m + scale * (now_m - nearly_m);
    if (place_m < first + 1 || place_m > last - 0.5 || !sighted_before(landmark.kind)) continue;
    const bool reported = std::any_of(seen_.begin(), seen_.end(), [&](const Seen& seen) {
      return seen.sighting.kind == landmark.kind &&
             std::abs(seen.place_m - place_m) < 3 * relative_sigma_m(seen, landmark.landmark->sigma_m, now_m);
    });
    if (!reported) fit *= 1 - parameters_.detection;
  }
  return fit;
}

double LandmarkMatcher::sighting_fits(const Seen& seen, double path_m, double now_m) const {
  const auto mapped = near(seen.sighting.kind, path_m - kDensityReachM, path_m + kDensityReachM);
  const double per_m = static_cast<double>(mapped.size()) / (2 * kDensityReachM);
  const double by_chance = seen.unmapped_per_m + (1 - seen.sighting.confidence) * per_m;
  double density = by_chance;
  for (const auto* landmark : mapped) {
    if (other_side(seen.sighting.lateral_m, landmark->lateral_m)) continue;
    const double off_m = landmark->distance_m - path_m;
    const double moved = std::abs(off_m) < parameters_.moved_m ? parameters_.moved / (2 * parameters_.moved_m) : 0.0;
    const double relative_m = relative_sigma_m(seen, landmark->landmark->sigma_m, now_m);
    density +=
        parameters_.detection * seen.sighting.confidence * ((1 - parameters_.moved) * gauss(off_m, relative_m) + moved);
  }
  return density / (by_chance + parameters_.detection * per_m);
}

double LandmarkMatcher::mapped_per_m(track::LandmarkKind kind, double path_m) const {
  return static_cast<double>(near(kind, path_m - kDensityReachM, path_m + kDensityReachM).size()) /
         (2 * kDensityReachM);
}

std::vector<const track::PathLandmark*> LandmarkMatcher::near(track::LandmarkKind kind, double from_m,
                                                              double to_m) const {
  std::vector<const track::PathLandmark*> found;
  for (const auto& landmark : path_->landmarks_between(from_m, to_m)) {
    if (landmark.kind == kind) found.push_back(&landmark);
  }
  return found;
}

bool LandmarkMatcher::sighted_before(track::LandmarkKind kind) const {
  return std::any_of(seen_.begin(), seen_.end(), [&](const Seen& seen) { return seen.sighting.kind == kind; });
}

bool LandmarkMatcher::is_of(const Seen& seen, const Sighting& sighting, double place_m) const {
  return seen.sighting.kind == sighting.kind && !other_side(seen.sighting.lateral_m, sighting.lateral_m) &&
         std::abs(seen.place_m - place_m) < 3 * relative_sigma_m(seen, sighting.sigma_m, place_m);
}

double LandmarkMatcher::relative_sigma_m(const Seen& seen, double map_sigma_m, double now_m) const {
  return std::hypot(1.5 * seen.sighting.sigma_m, std::numbers::sqrt2 * map_sigma_m,
                    kOddM + kScaleChanges * parameters_.scale_sigma * std::abs(now_m - seen.place_m));
}

}  // namespace railfix::map_matcher
