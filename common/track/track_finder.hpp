// Which tracks are near a place, on a map of any size.
#pragma once

#include <memory>
#include <unordered_map>
#include <vector>

#include "track/map.hpp"

namespace railfix::track {

/// A track near a place.
struct NearTrack {
  uint32_t edge = 0;
  double offset_m = 0;
  double lateral_m = 0;  // of the place, left of the track positive; beyond an edge's end its distance from there
};

/// A grid of cells, each with the elements that touch it. Made once for a map that does not change any more, then read
/// from any thread; keeps the map alive.
class TrackFinder {
 public:
  explicit TrackFinder(std::shared_ptr<const Map> map);
  /// The nearest place of every edge within the radius, nearest first.
  [[nodiscard]] std::vector<NearTrack> near(double easting_m, double northing_m, double radius_m) const;

 private:
  struct Piece {
    uint32_t edge = 0;
    uint32_t element = 0;
  };
  void enter(const Edge& edge, uint32_t element);
  [[nodiscard]] std::vector<Piece> pieces_near(double easting_m, double northing_m, double radius_m) const;

  std::shared_ptr<const Map> map_;
  std::unordered_map<uint64_t, std::vector<Piece>> cells_;
};

}  // namespace railfix::track
