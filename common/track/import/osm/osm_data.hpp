// Railways out of OpenStreetMap, as far as a map needs them.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <unordered_map>
#include <vector>

#include "core/result.hpp"
#include "track/projection.hpp"

namespace railfix::track {

using OsmTags = std::map<std::string, std::string>;

struct OsmNode {
  GeoPoint place;
  OsmTags tags;  // only of nodes that say something about the railway
};

struct OsmWay {
  int64_t id = 0;
  std::vector<int64_t> nodes;
  OsmTags tags;
};

struct OsmData {
  std::unordered_map<int64_t, OsmNode> nodes;
  std::vector<OsmWay> ways;       // tracks
  std::vector<OsmWay> bridges;    // of other things, which may lead over a track
  std::vector<OsmWay> platforms;  // outlines, edges, or lines along the middle
  std::vector<std::string> problems;
};

/// The problem of an extract with this remark, in quotation marks: Overpass sends what it has when its time or memory
/// is over, and says so there.
std::string problem_of_remark(const std::string& quoted);

/// Nodes that are nowhere on the Earth, and what may be wrong with them.
class NodesNowhere {
 public:
  void add(const GeoPoint& place);
  /// Adds a sentence, where there are any.
  void tell(std::vector<std::string>& problems) const;

 private:
  size_t count_ = 0;
  size_t swapped_ = 0;
};

/// Is this way track that a train runs on? railway=rail, light_rail, narrow_gauge, subway, and tram where asked for.
bool is_track(const OsmTags& tags, bool with_trams);

/// Is this way no such track, but a road, path, canal or other railway on a bridge?
bool leads_over(const OsmTags& tags, bool with_trams);
/// Is this a platform of such trains, or an edge of one? Those of buses (public_transport=platform without a word of a
/// train) are none.
bool is_platform(const OsmTags& tags, bool with_trams);
/// A platform with holes in it; the ways around it, by their role, are then its outline.
bool is_platform_relation(const OsmTags& tags, bool with_trams);
bool is_outline(const std::string& role);
/// A node that is one of the masts that carry the wire. They stand beside the tracks, and no way leads there.
bool is_mast(const OsmTags& tags);
/// There, and not "no", nor what converters write for that.
bool is_set(const OsmTags& tags, const char* key);
/// Empty where there is no such key.
std::string value_of(const OsmTags& tags, const char* key);
/// The name of a track's line, else its number.
std::string line_in(const OsmTags& tags);

/// The ways among which this one belongs; nullptr = it is of no use.
std::vector<OsmWay>* ways_for(OsmData& data, const OsmTags& tags, bool with_trams);

/// OSM XML or PBF, also compressed (.osm, .pbf, .osm.gz, .osm.bz2). Memory grows with the railways and bridges in the
/// file only.
core::Result<OsmData> read_osm(const std::filesystem::path& file, bool with_trams);

/// The id of a node that its source gives none: both coordinates to 1e-7 degree, as OpenStreetMap stores them.
int64_t id_of_place(const GeoPoint& place);

/// Overpass JSON ("elements", the places of nodes in their own or by `out geom;` in the ways) or GeoJSON ("features").
/// GeoJSON has no nodes: equal coordinates (1e-7 degree) are one node.
core::Result<OsmData> read_osm_json(const std::filesystem::path& file, bool with_trams);

}  // namespace railfix::track
