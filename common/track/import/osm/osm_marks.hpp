// What stands beside a chain of OpenStreetMap segments, and how fast trains may run on it.
#pragma once

#include "track/import/network.hpp"
#include "track/import/osm/osm_chains.hpp"
#include "track/import/osm/osm_points.hpp"

namespace railfix::track {

/// maxspeed: "80" (km/h) or "50 mph"; nothing where it says anything else.
std::optional<double> speed_mps_of(const std::string& text);

/// What ways say of speeds and grades and is no number, one sentence each.
std::vector<std::string> unread_tags(const OsmData& data);

/// Between the ends of the chain; add_marks_at_nodes() does those.
class OsmMarks {
 public:
  OsmMarks(const OsmData& data, const OsmChain& chain, OsmPoints& points)
      : data_(data), chain_(chain), points_(points) {}
  /// REQUIRES: the track's alignment was made from the chain.
  void add(ImportedTrack& track) const;

 private:
  void add_structures(ImportedTrack& track) const;
  void add_points(ImportedTrack& track) const;
  void add_speeds(ImportedTrack& track) const;
  void add_underbridge(double from_m, double to_m, size_t way, ImportedTrack& track) const;
  [[nodiscard]] double offset_of(size_t point, const ImportedTrack& track) const;
  [[nodiscard]] const OsmTags& tags_of(size_t segment) const { return data_.ways[chain_.ways[segment]].tags; }

  const OsmData& data_;
  const OsmChain& chain_;
  OsmPoints& points_;
};

}  // namespace railfix::track
