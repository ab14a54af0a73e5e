// What goes into the map matcher and what comes out of it, without DDS.
#pragma once

#include <cmath>
#include <cstdint>

#include "track/map.hpp"

namespace railfix::map_matcher {

struct Sighting {
  int64_t stamp_ns = 0;
  track::LandmarkKind kind = track::LandmarkKind::unknown;
  double distance_ahead_m = 0;  // of the camera's foot at the stamp
  double lateral_m = 0;
  double sigma_m = 0;
  double confidence = 0;
};

/// Landmarks of a kind so near together, balises of a group, are missed together, and the map has them wrong together.
inline constexpr double kOneThingM = 30;
/// Between a train's own rails: nobody sees it there from the track beside.
constexpr bool lies_in_track(track::LandmarkKind kind, double lateral_m) {
  constexpr double kOwnRailsM = 1.0;
  const bool in_track = kind == track::LandmarkKind::balise || kind == track::LandmarkKind::frog;
  return in_track && lateral_m > -kOwnRailsM && lateral_m < kOwnRailsM;
}

enum class TurnSensor : uint8_t { camera, gyro };

inline constexpr double kLeastWayM = 1e-5;  // a train that stands turns nothing

/// How far the train ran and how it turned meanwhile (left positive).
struct Turn {
  double way_m = 0;
  double turn_rad = 0;
  double sigma_rad = 0;  // noise of this piece alone
  double bias_rad = 0;   // what one sigma of the sensor's constant error has turned meanwhile
  TurnSensor sensor = TurnSensor::camera;
  double bias_walk = 0;   // by so much may that error have changed meanwhile (variance, in its sigmas)
  double duration_s = 0;  // 0: not known
  double jump_rad = 0;    // what one sigma of another constant error, that of a failed sensor, has turned; 0: none
};

/// Where fusion thinks the train is: only a window to search in.
struct Prior {
  double path_distance_m = 0;
  double over_m = 0;       // may be so far behind
  double under_m = 0;      // ... or in front
  double travelled_m = 0;  // distance run, to relate sightings to each other

  /// Every figure is one, and the window is small enough to search while the train runs.
  [[nodiscard]] bool usable() const {
    return std::isfinite(path_distance_m) && std::isfinite(travelled_m) && over_m >= 0 && under_m >= 0 &&
           over_m + under_m < kWidestM;
  }
  static constexpr double kWidestM = 10000;
};

/// How all that is sighted fits the map near the place.
enum class SightingsFit : uint8_t { not_told, nowhere, here };

/// A place of the camera's foot, from map and measurement alone.
struct Fix {
  int64_t stamp_ns = 0;
  double path_distance_m = 0;
  double sigma_m = 0;
  double probability = 0;
  uint32_t landmark = 0;  // 0 = from curvature
  SightingsFit sightings_fit = SightingsFit::not_told;
};

}  // namespace railfix::map_matcher
