// Which track of several side by side? A train that was told on the neighbour of its track meets and turns much as that
// one would have it: what is measured speaks for a track only where no track beside it would have given the same.
#pragma once

#include <memory>
#include <vector>

#include "track/track_finder.hpp"
#include "track/ways.hpp"

namespace railfix::track {

/// Abeam of a place on another track.
struct TrackBeside : NearTrack {
  double turned_rad = 0;  // of growing offsets there, against those at the place
};

class TracksBeside {
 public:
  /// REQUIRES: the map does not change any more.
  explicit TracksBeside(std::shared_ptr<const Map> map) : map_(std::move(map)), finder_(map_), junctions_(*map_) {}

  /// The other tracks within 15 m of the place, abeam of it. Drawings (edges that lie nowhere) say nothing of that:
  /// none. REQUIRES: the edge is on the map.
  [[nodiscard]] std::vector<TrackBeside> beside(const EdgePosition& place) const;
  [[nodiscard]] bool any_at(const EdgePosition& place) const { return !beside(place).empty(); }
  /// More than one track runs within 15 m of the point (metres of the map).
  [[nodiscard]] bool many_at(double easting_m, double northing_m) const;
  /// A train on a track within 15 m would sight it, or one of its kind, as far along and as far to the side as a train
  /// on its own track sights it. Where the map does not know how far aside something stands, whatever would be sighted
  /// on that side is alike.
  [[nodiscard]] bool has_alike(const Landmark& landmark) const;

 private:
  /// Tracks abeam of a point; what lies beyond an edge's end is not.
  [[nodiscard]] std::vector<NearTrack> abeam(double easting_m, double northing_m) const;

  /// From a train on that track.
  [[nodiscard]] bool has_alike(const Landmark& landmark, const TrackBeside& track) const;

  std::shared_ptr<const Map> map_;
  TrackFinder finder_;
  Junctions junctions_;
};

}  // namespace railfix::track
