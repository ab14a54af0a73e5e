// Bridges that lead over the tracks: roads, paths, canals and other lines of an OpenStreetMap extract.
#pragma once

#include <unordered_map>

#include "track/import/osm/osm_marks.hpp"

namespace railfix::track {

/// The level of a way against its neighbours: layer=*, else one up for a bridge and one down for a tunnel.
int layer_of(const OsmTags& tags);

class OsmOverbridges {
 public:
  OsmOverbridges(const OsmData& data, const Projection& projection);
  /// One landmark for every bridge over the open track, as wide as roads usually are. A bridge without a level above
  /// the track's is left out. REQUIRES: the track's alignment was made from the chain.
  void add(const OsmData& data, const OsmChain& chain, ImportedTrack& track) const;

 private:
  struct Segment {
    Eigen::Vector2d a;
    Eigen::Vector2d b;
    int64_t node_a = 0;
    int64_t node_b = 0;
    int layer = 0;
    const OsmTags* tags = nullptr;
  };
  struct Crossing {
    double offset_m = 0;
    double half_m = 0;  // along the track, to either edge of the bridge
    std::string name;
  };

  void take(const OsmWay& way, const OsmData& data, const Projection& projection);
  [[nodiscard]] std::vector<Crossing> crossings(const OsmData& data, const OsmChain& chain,
                                                const ImportedTrack& track) const;

  std::vector<Segment> segments_;
  std::unordered_map<int64_t, std::vector<size_t>> in_cell_;
};

}  // namespace railfix::track
