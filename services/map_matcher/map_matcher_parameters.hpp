// What the map matcher and its parts are told, without DDS.
#pragma once

#include <string>

#include "map_matcher/landmark_matcher.hpp"
#include "map_matcher/locate/place_search.hpp"
#include "map_matcher/shape/curvature_matcher.hpp"
#include "map_matcher/shape/curve_exit_matcher.hpp"
#include "map_matcher/track_choice/gyro_turn.hpp"
#include "map_matcher/track_choice/track_chooser.hpp"

namespace railfix::map_matcher {

struct MapMatcherParameters {
  bool use_landmarks = true;
  bool use_curvature = true;
  std::string curve_method = "likelihood";  // or "exits"
  bool choose_track = true;
  bool locate = true;  // a place that nobody knows is searched for
  double camera_bias_per_m = 1e-4;
  double view_ahead_m = 8.0;
  double view_rate_sigma_per_m2 = 3e-5;
  double least_speed_mps = 1.0;
  double lag_m = 20.0;
  double match_every_m = 5.0;
  LandmarkParameters landmarks;
  CurvatureParameters curvature;
  GyroParameters gyro;
  TrackParameters track;
  PlaceSearchParameters search;

  /// What several parts take is set once: the lag of the body, and the chances of sightings under `landmarks`.
  [[nodiscard]] TrackParameters track_parameters() const { return shared(track); }
  [[nodiscard]] PlaceSearchParameters search_parameters() const {
    PlaceSearchParameters p = search;
    p.locator = shared(p.locator);
    return p;
  }
  [[nodiscard]] CurvatureParameters curvature_parameters() const {
    CurvatureParameters p = curvature;
    p.lag_m = lag_m;
    return p;
  }
  [[nodiscard]] CurveExitParameters exit_parameters() const {
    CurveExitParameters p;
    p.most_lag_m = lag_m;
    return p;
  }

 private:
  template <typename Parameters>
  [[nodiscard]] Parameters shared(Parameters p) const {
    p.lag_m = lag_m;
    p.detection = landmarks.detection;
    p.false_per_m = landmarks.false_per_m;
    return p;
  }
};

}  // namespace railfix::map_matcher
