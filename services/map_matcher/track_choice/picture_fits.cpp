#include "map_matcher/track_choice/picture_fits.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "track/aside.hpp"

namespace railfix::map_matcher {
namespace {

constexpr double kMostSquared = 12.0;  // a picture that fits worse than this is not believed more
constexpr double kSideM = 0.3;
constexpr double kViewStepM = 3.0;  // places where the curvature in a picture is read from the map

/// Calls `take` with every landmark of the legs that reach so near to a place, the leg, and where on the route it is.
template <class Take>
void each_landmark(const track::Map& map, const track::Route& route, double at_m, double within_m, const Take& take) {
  for (const auto& leg : route.legs()) {
    if (leg.begin_m > at_m + within_m || leg.end_m() < at_m - within_m) continue;
    for (const auto* landmark : map.landmarks_on(leg.run.edge->id))
      take(*landmark, leg, leg.begin_m + leg.run.into_m(landmark->offset_m));
  }
}

}  // namespace

// The picture is taken where the train really is, anywhere in the window: what fits one of these places fits.
double view_fits(const track::Route& route, const ViewedCurvature& view, const TrackParameters& parameters) {
  double least = INFINITY;
  double most = -INFINITY;
  const double end_m = view.last_m + parameters.view_to_m;
  for (double m = view.first_m + parameters.view_from_m; m < end_m + kViewStepM; m += kViewStepM) {
    const double mapped = route.curvature_at(std::min(m, end_m));
    const double rough = parameters.curvature_share * std::abs(mapped);
    least = std::min(least, mapped - rough);
    most = std::max(most, mapped + rough);
  }
  const double beyond = std::max({0.0, least - view.curvature_per_m, view.curvature_per_m - most});
  return -0.5 * std::min(kMostSquared, beyond * beyond / (view.sigma_per_m * view.sigma_per_m)) /
         parameters.correlated_bins;
}

double sighting_fits(const track::Map& map, const track::Route& route, const SightedOnRoute& seen,
                     const TrackParameters& parameters) {
  const Sighting& sighting = seen.sighting;
  const double seen_m = seen.at_m;
  const double sigma_m = seen.sigma_m;
  const bool sided = std::abs(sighting.lateral_m) > kSideM;
  double density = parameters.false_per_m + (1 - std::clamp(sighting.confidence, 0.0, 1.0)) / (6 * sigma_m);
  const auto add = [&](const track::Landmark& landmark, const track::Route::Leg& leg, double at_m) {
    if (track::seen_along(landmark.kind, leg.run.forward) != sighting.kind) return;
    const double z = (at_m - seen_m) / sigma_m;
    const double lateral_m = leg.run.forward ? landmark.lateral_m : -landmark.lateral_m;
    double side = 1;
    if (sided && std::abs(lateral_m) > kSideM) {
      const bool fits = (lateral_m > 0) == (sighting.lateral_m > 0) &&
                        track::fits_aside(sighting.lateral_m, lateral_m, track::is_aside_measured(landmark));
      side = fits ? 1 - parameters.wrong_side : parameters.wrong_side;
    }
    density += parameters.detection * sighting.confidence * side * std::exp(-0.5 * z * z) /
               (sigma_m * std::sqrt(2 * std::numbers::pi));
  };
  each_landmark(map, route, seen_m, 5 * sigma_m, add);
  return density;
}

bool has_one_at(const track::Map& map, const track::Route& route, track::LandmarkKind kind, double at_m,
                double within_m) {
  bool has = false;
  each_landmark(map, route, at_m, within_m, [&](const track::Landmark& landmark, const auto&, double its_m) {
    has = has || (landmark.kind == kind && std::abs(its_m - at_m) < within_m);
  });
  return has;
}

}  // namespace railfix::map_matcher
