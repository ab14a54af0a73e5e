// Which track of several side by side? A train that was told on the neighbour of its track meets and turns much as that
// one would have it: what is measured speaks for a track only where no track beside it would have given the same.
#pragma once

#include <memory>
#include <vector>

#include "track/track_finder.hpp"

namespace railfix::track {

/// Abeam of a place on another track.
struct TrackBeside : NearTrack {
  double turned_rad = 0;  // of growing offsets there, against those at the place
};

class TracksBeside {
 public:
  /// REQUIRES: the map does not change any more.
  explicit TracksBeside(std::shared_ptr<const Map> map) : map_(std::move(map)), finder_(map_) {}

  /// The other tracks within 15 m of the place, abeam of it. Drawings (edges that lie nowhere) say nothing of that:
  /// none. REQUIRES: the edge is on the map.
  [[nodiscard]] std::vector<TrackBeside> beside(const EdgePosition& place) const;
  [[nodiscard]] bool any_at(const EdgePosition& place) const { return !beside(place).empty(); }
  /// More than one track runs within 15 m of the point (metres of the map).
  [[nodiscard]] bool many_at(double easting_m, double northing_m) const;
  /// A track within 15 m has one of its kind where a train on it would see it alike: as far along and as far to the
  /// side.
  [[nodiscard]] bool has_alike(const Landmark& landmark) const;

 private:
  /// Tracks abeam of a point; what lies beyond an edge's end is not.
  [[nodiscard]] std::vector<NearTrack> abeam(double easting_m, double northing_m) const;

  std::shared_ptr<const Map> map_;
  TrackFinder finder_;
};

}  // namespace railfix::track
