// How the tracks of an OpenStreetMap extract run on from a node.
#pragma once

#include <cstdint>
#include <optional>
#include <unordered_map>
#include <vector>

#include "track/import/network.hpp"
#include "track/import/osm/osm_chains.hpp"

namespace railfix::track {

/// REQUIRES: data and chains stay as they are as long as it is used.
class OsmOnward {
 public:
  OsmOnward(const OsmData& data, const std::vector<OsmChain>& chains);
  /// The track that leaves the chain's first node (at_end: its last one) along the chain. Its first two points may be
  /// 2 m apart, and say less of where it goes than those further on, also of chains that follow.
  [[nodiscard]] Onward of(const OsmChain& chain, bool at_end) const;

 private:
  /// A chain as run from one of its ends.
  struct Run {
    const OsmChain* chain = nullptr;
    bool from_end = false;
  };
  [[nodiscard]] const OsmWay& way_of(const OsmChain& chain, bool at_end) const;
  [[nodiscard]] std::optional<Run> after(const Run& run) const;
  [[nodiscard]] double heading_rad(Run run) const;

  const OsmData& data_;
  std::unordered_map<int64_t, std::vector<Run>> from_node_;
};

}  // namespace railfix::track
