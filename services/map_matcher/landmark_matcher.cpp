#include "map_matcher/landmark_matcher.hpp"

#include <algorithm>
#include <cmath>

#include "map_matcher/inputs.hpp"

namespace railfix::map_matcher {
namespace {

constexpr double kUsualConfidence = 0.95;  // of the sightings of which false_per_m are false
constexpr double kMovedSigmas = 3.0;       // what is less is not moved
constexpr size_t kMostCandidates = 50;     // are searched in a quarter of a second: a mast comes every second
constexpr double kConfirmed = 1e-6;        // odds against the place behind three or four landmarks that fit, ...
constexpr double kMostOdds = 1e3;          // ... and so many more bring it back when nothing has
constexpr double kLost = 1.0;  // a place that was confirmed is in doubt again: the map may be wrong in between

}  // namespace

// The window only selects. An object that was met before says nothing new: what the map has wrong about it is the same
// each time.
std::optional<Fix> LandmarkMatcher::add(const Sighting& sighting, const Prior& prior) {
  if (!prior.usable() || !has_sense(sighting)) return std::nullopt;
  const double place_m = prior.travelled_m + sighting.distance_ahead_m;
  const double margin_m = parameters_.window_margin_m + 3 * sighting.sigma_m;
  const double expected_m = prior.path_distance_m + sighting.distance_ahead_m;
  const Window window{expected_m, expected_m - prior.over_m - margin_m, expected_m + prior.under_m + margin_m};
  const bool again = seen_.make_room(sighting, place_m);
  auto candidates = landmarks_of_kind(*path_, sighting.kind, window.from_m, window.to_m);
  std::erase_if(candidates, [&](const auto* mark) { return !fits_aside(sighting, *mark); });
  if (candidates.size() > kMostCandidates) {
    seen_.add(sighting, place_m);  // for when the window is smaller, or for those of a rarer kind
    return std::nullopt;
  }
  const Weights weights = weigh(sighting, place_m, window, candidates);
  if (weights.here > 0 && !again) {
    odds_elsewhere_ = std::clamp(weights.elsewhere / weights.here, std::min(odds_elsewhere_, kConfirmed), kMostOdds);
    seen_.unmapped(sighting.kind).learn(place_m, weights.nothing / weights.here);
  }
  confirmed_ = odds_elsewhere_ <= (confirmed_ ? kLost : kConfirmed);
  told_apart_ = told_apart_ && confirmed_;
  seen_.add(sighting, place_m);
  const double sum = weights.here + weights.elsewhere;
  const auto* best = weights.best;
  if (best == nullptr || !(weights.of_best >= parameters_.min_probability * sum)) return std::nullopt;
  told_apart_ = told_apart_ || (confirmed_ && is_told_apart(*best, place_m, window, prior));
  return Fix{sighting.stamp_ns,
             best->distance_m - sighting.distance_ahead_m,
             std::hypot(sighting.sigma_m, best->landmark->sigma_m),
             weights.of_best / sum,
             best->landmark->id,
             told_apart_ ? SightingsFit::here : SightingsFit::not_told};
}

// Every mapped landmark of the kind in the window is one hypothesis, weighed by how well the earlier sightings fit it;
// that it stands elsewhere than the map says is another; the last one is that this sighting is false, weighed by the
// mean fit over the window. A confidence below the usual is a chance for the sighting, not for each landmark in the
// window. That the train is not in the window at all is weighed by what such a sighting would be by chance; the odds of
// that go on from sighting to sighting.
LandmarkMatcher::Weights LandmarkMatcher::weigh(const Sighting& sighting, double place_m, const Window& window,
                                                const std::vector<const track::PathLandmark*>& candidates) const {
  const double length_m = window.to_m - window.from_m;
  const double confidence = std::clamp(sighting.confidence, 0.01, 0.999);
  const double expected = std::max(1.0, parameters_.detection * static_cast<double>(candidates.size()));
  const double doubt = std::max(0.0, kUsualConfidence - confidence);
  const SightingHistory lately = seen_.lately(place_m);
  const double earlier = lately.mean_fit(*path_, window.from_m - place_m, window.to_m - place_m, place_m);
  const double unmapped_per_m = lately.unmapped_per_m(sighting.kind);
  Weights weights;
  weights.nothing = earlier * (doubt * expected + unmapped_per_m * length_m);
  weights.here = weights.nothing;
  for (const auto* landmark : candidates) {
    const double shift_m = landmark->distance_m - place_m;
    const double chance = confidence * parameters_.detection;
    const double weight = chance * (1 - parameters_.moved) * lately.fits(*path_, shift_m, place_m);
    const double still_m =
        std::min(kMovedSigmas * std::hypot(sighting.sigma_m, landmark->landmark->sigma_m), 0.5 * parameters_.moved_m);
    const double moved = 0.5 * (lately.mean_fit(*path_, shift_m - parameters_.moved_m, shift_m - still_m, place_m) +
                                lately.mean_fit(*path_, shift_m + still_m, shift_m + parameters_.moved_m, place_m));
    weights.here += weight + chance * parameters_.moved * moved;
    if (weight <= weights.of_best) continue;
    weights.best = landmark;
    weights.of_best = weight;
  }
  const double by_chance_per_m =
      unmapped_per_m + parameters_.detection * mapped_per_m(*path_, sighting.kind, window.expected_m);
  weights.elsewhere = odds_elsewhere_ * earlier * length_m * by_chance_per_m;
  return weights;
}

// Sightings that are of one landmark each are so at every place where landmarks are as far apart; by chance, which is
// weighed against the place, they would not be.
bool LandmarkMatcher::is_told_apart(const track::PathLandmark& landmark, double place_m, const Window& window,
                                    const Prior& prior) const {
  return !AlikePlaces(seen_, *path_)
              .any({.shift_m = landmark.distance_m - place_m,
                    .least_m = window.from_m - place_m,
                    .most_m = window.to_m - place_m,
                    .now_m = place_m,
                    .since_told_m = prior.travelled_m - told_m_});
}

}  // namespace railfix::map_matcher
