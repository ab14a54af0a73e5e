// How well what a picture shows fits one way through the switches: the bend of the rails, and sighted landmarks.
#pragma once

#include "map_matcher/match_types.hpp"
#include "map_matcher/track_choice/track_parameters.hpp"
#include "track/ways.hpp"

namespace railfix::map_matcher {

/// The curvature of the rails (left positive) in a picture taken from somewhere between two places on a route.
struct ViewedCurvature {
  double curvature_per_m = 0;
  double sigma_per_m = 0;
  double first_m = 0;
  double last_m = 0;
};
/// Log likelihood.
double view_fits(const track::Route& route, const ViewedCurvature& view, const TrackParameters& parameters);

/// A landmark that was sighted there on a route, give or take sigma_m.
struct SightedOnRoute {
  Sighting sighting;
  double at_m = 0;
  double sigma_m = 0;
};
/// Likelihood, 1/m.
double sighting_fits(const track::Map& map, const track::Route& route, const SightedOnRoute& seen,
                     const TrackParameters& parameters);

/// The route has a landmark of that kind, as the map has it, near the place.
bool has_one_at(const track::Map& map, const track::Route& route, track::LandmarkKind kind, double at_m,
                double within_m);

}  // namespace railfix::map_matcher
