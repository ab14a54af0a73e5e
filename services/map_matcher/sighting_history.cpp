#include "map_matcher/sighting_history.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace railfix::map_matcher {
namespace {

constexpr double kDensityReachM = 200;  // of mapped landmarks, for the chance of a random hit
constexpr double kFitStepM = 0.7;       // earlier sightings fit within about so much
constexpr size_t kMostSightings = 12;
constexpr double kRareM = 3000;        // over which distances between rare things tell places apart
constexpr int kScaleSteps = 4;         // to either side
constexpr double kScaleStep = 0.6;     // sigmas
constexpr double kScaleChanges = 0.3;  // share of the scale's sigma that differs from place to place
constexpr double kOddM = 0.1;
constexpr double kUnmappedReachM = 5000;  // over which a map lacks landmarks as it does here

double gauss(double error, double sigma) {
  const double z = error / sigma;
  return std::exp(-0.5 * z * z) / (sigma * std::sqrt(2 * std::numbers::pi));
}

}  // namespace

void UnmappedRate::learn(double place_m, double probability) {
  const double way_m = std::max(0.0, place_m - last_m_.value_or(place_m));
  const double kept = std::exp(-way_m / kUnmappedReachM);
  count_ = kept * count_ + probability;
  way_m_ = kept * way_m_ + way_m;
  last_m_ = place_m;
}

bool SightingHistory::make_room(const Sighting& sighting, double place_m) {
  const double reach_m = std::max(parameters_.history_m, kRareM);
  std::erase_if(seen_, [&](const Seen& seen) { return std::abs(place_m - seen.place_m) > reach_m; });
  return std::erase_if(seen_, [&](const Seen& seen) { return is_of(seen, sighting, place_m); }) > 0;
}

void SightingHistory::add(const Sighting& sighting, double place_m) {
  seen_.push_back({sighting, place_m});
  if (seen_.size() > kMostSightings) seen_.pop_front();
}

void SightingHistory::begin_anew() {
  seen_.clear();
  for (auto& [kind, rate] : unmapped_) rate.begin_way();
}

SightingHistory SightingHistory::lately(double place_m) const {
  SightingHistory near = *this;
  std::erase_if(near.seen_, [&](const Seen& seen) { return std::abs(place_m - seen.place_m) > parameters_.history_m; });
  return near;
}

SightingHistory SightingHistory::turned_round() const {
  SightingHistory turned = *this;
  for (Seen& seen : turned.seen_) {
    seen.sighting.kind = track::seen_along(seen.sighting.kind, false);
    seen.sighting.lateral_m = -seen.sighting.lateral_m;
    seen.place_m = -seen.place_m;
  }
  return turned;
}

double SightingHistory::mean_fit(const track::Path& path, double from_m, double to_m, double now_m) const {
  const int steps = std::max(1, static_cast<int>(std::ceil((to_m - from_m) / kFitStepM)));
  double sum = 0;
  for (int i = 0; i < steps; ++i) sum += fits(path, from_m + (to_m - from_m) * (i + 0.5) / steps, now_m);
  return sum / steps;
}

// The odometer's scale is unknown, but the same for all of them.
double SightingHistory::fits(const track::Path& path, double shift_m, double now_m, Against against) const {
  if (seen_.empty()) return 1;
  double sum = 0;
  double weights = 0;
  for (int i = -kScaleSteps; i <= kScaleSteps; ++i) {
    const double z = kScaleStep * i;
    const double weight = std::exp(-0.5 * z * z);
    weights += weight;
    sum += weight * fits_at_scale(path, shift_m, z * parameters_.scale_sigma, now_m, against);
  }
  return sum / weights;
}

double SightingHistory::fits_at_scale(const track::Path& path, double shift_m, double scale, double now_m,
                                      Against against) const {
  double fit = 1;
  for (const auto& seen : seen_) {
    const double path_m = seen.place_m + shift_m - scale * (now_m - seen.place_m);
    fit *= sighting_fits(path, seen, path_m, now_m, against);
  }
  // Landmarks between the sightings that nobody reported.
  const auto [first, last] = std::minmax(seen_.front().place_m, now_m);
  const double reach_m = 1 + std::abs(scale) * (last - first);
  for (const auto& landmark : path.landmarks_between(first + shift_m - reach_m, last + shift_m + reach_m)) {
    const double nearly_m = landmark.distance_m - shift_m;
    const double place_m = nearly_m + scale * (now_m - nearly_m);
    if (place_m < first + 1 || place_m > last - 0.5 || !has(landmark.kind)) continue;
    const bool reported = std::any_of(seen_.begin(), seen_.end(), [&](const Seen& seen) {
      return seen.sighting.kind == landmark.kind &&
             std::abs(seen.place_m - place_m) < 3 * relative_sigma_m(seen, landmark.landmark->sigma_m, now_m);
    });
    if (!reported) fit *= 1 - parameters_.detection;
  }
  return fit;
}

double SightingHistory::sighting_fits(const track::Path& path, const Seen& seen, double path_m, double now_m,
                                      Against against) const {
  const auto mapped = landmarks_of_kind(path, seen.sighting.kind, path_m - kDensityReachM, path_m + kDensityReachM);
  const double per_m = static_cast<double>(mapped.size()) / (2 * kDensityReachM);
  const double by_chance = unmapped_per_m(seen.sighting.kind) + (1 - seen.sighting.confidence) * per_m;
  double density = by_chance;
  for (const auto* landmark : mapped) {
    if (!fits_aside(seen.sighting, *landmark)) continue;
    const double off_m = landmark->distance_m - path_m;
    const double moved = std::abs(off_m) < parameters_.moved_m ? parameters_.moved / (2 * parameters_.moved_m) : 0.0;
    const double relative_m = relative_sigma_m(seen, landmark->landmark->sigma_m, now_m);
    density +=
        parameters_.detection * seen.sighting.confidence * ((1 - parameters_.moved) * gauss(off_m, relative_m) + moved);
  }
  return against == Against::nothing ? density : density / (by_chance + parameters_.detection * per_m);
}

double SightingHistory::unmapped_per_m(track::LandmarkKind kind) const {
  const auto rate = unmapped_.find(kind);
  return rate == unmapped_.end() ? parameters_.false_per_m : rate->second.per_m();
}

bool SightingHistory::has(track::LandmarkKind kind) const {
  return std::any_of(seen_.begin(), seen_.end(), [&](const Seen& seen) { return seen.sighting.kind == kind; });
}

bool SightingHistory::is_of(const Seen& seen, const Sighting& sighting, double place_m) const {
  return seen.sighting.kind == sighting.kind && track::fits_aside(seen.sighting.lateral_m, sighting.lateral_m) &&
         std::abs(seen.place_m - place_m) < 3 * relative_sigma_m(seen, sighting.sigma_m, place_m);
}

double SightingHistory::relative_sigma_m(const Seen& seen, double map_sigma_m, double now_m) const {
  return std::hypot(1.5 * seen.sighting.sigma_m, std::numbers::sqrt2 * map_sigma_m,
                    kOddM + kScaleChanges * parameters_.scale_sigma * std::abs(now_m - seen.place_m));
}

std::vector<const track::PathLandmark*> landmarks_of_kind(const track::Path& path, track::LandmarkKind kind,
                                                          double from_m, double to_m) {
  std::vector<const track::PathLandmark*> found;
  for (const auto& landmark : path.landmarks_between(from_m, to_m)) {
    if (landmark.kind == kind) found.push_back(&landmark);
  }
  return found;
}

double mapped_per_m(const track::Path& path, track::LandmarkKind kind, double path_m) {
  return static_cast<double>(landmarks_of_kind(path, kind, path_m - kDensityReachM, path_m + kDensityReachM).size()) /
         (2 * kDensityReachM);
}

}  // namespace railfix::map_matcher
