// Which track of several side by side? A start that was told may be the neighbour of the right one: what is measured
// speaks for it only where no track beside it would have given the same.
#pragma once

#include <memory>

#include "track/track_finder.hpp"

namespace railfix::fusion {

/// Read from one thread.
class TracksBeside {
 public:
  /// REQUIRES: the map does not change any more.
  explicit TracksBeside(std::shared_ptr<const track::Map> map) : map_(std::move(map)), finder_(map_) {}

  /// Another track runs within 15 m of the place. Drawings (edges that lie nowhere) say nothing of that: false.
  /// REQUIRES: the edge is on the map.
  [[nodiscard]] bool any_at(const track::EdgePosition& place) const;
  /// More than one track runs within 15 m of the point (metres of the map).
  [[nodiscard]] bool many_at(double easting_m, double northing_m) const;
  /// A track within 15 m has one of its kind where a train on it would see it alike: as far along and as far to the
  /// side.
  [[nodiscard]] bool has_alike(const track::Landmark& landmark) const;

 private:
  /// Tracks abeam of a point; what lies beyond an edge's end is not.
  [[nodiscard]] std::vector<track::NearTrack> abeam(double easting_m, double northing_m) const;
  [[nodiscard]] std::vector<track::NearTrack> beside(const track::EdgePosition& place) const;

  std::shared_ptr<const track::Map> map_;
  track::TrackFinder finder_;
};

}  // namespace railfix::fusion
