// How far a map reaches.
#pragma once

#include <algorithm>
#include <limits>

#include "track/map.hpp"

namespace railfix::fusion {

/// The rectangle around all its surveyed tracks, in the map's plane.
class MapExtent {
 public:
  explicit MapExtent(const track::Map& map) {
    for (const auto& edge : map.edges) {
      if (edge.is_drawn) continue;
      for (const double s_m : {0.0, 0.5 * edge.alignment.length_m(), edge.alignment.length_m()}) {
        const auto pose = edge.alignment.at(s_m).pose;
        west_m_ = std::min(west_m_, pose.easting_m);
        east_m_ = std::max(east_m_, pose.easting_m);
        south_m_ = std::min(south_m_, pose.northing_m);
        north_m_ = std::max(north_m_, pose.northing_m);
      }
    }
  }
  /// Not for a place that is no number.
  [[nodiscard]] bool is_far_off(double easting_m, double northing_m) const {
    return easting_m < west_m_ - kFarM || easting_m > east_m_ + kFarM || northing_m < south_m_ - kFarM ||
           northing_m > north_m_ + kFarM;
  }

 private:
  static constexpr double kFarM = 50'000;  // further than any line goes on beyond its map by chance
  double west_m_ = std::numeric_limits<double>::infinity();
  double east_m_ = -std::numeric_limits<double>::infinity();
  double south_m_ = std::numeric_limits<double>::infinity();
  double north_m_ = -std::numeric_limits<double>::infinity();
};

}  // namespace railfix::fusion
