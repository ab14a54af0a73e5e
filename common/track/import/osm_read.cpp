#include <algorithm>
#include <array>
#include <osmium/io/any_input.hpp>
#include <osmium/osm/node.hpp>
#include <osmium/osm/way.hpp>
#include <osmium/visitor.hpp>
#include <unordered_set>

#include "track/import/osm_data.hpp"

namespace railfix::track {
namespace {

OsmTags tags_of(const osmium::OSMObject& object) {
  OsmTags tags;
  for (const osmium::Tag& tag : object.tags()) tags.emplace(tag.key(), tag.value());
  return tags;
}

/// Ways first, then only the nodes they use: a country fits into memory.
OsmData read_two_passes(const std::string& file, bool with_trams) {
  OsmData out;
  std::unordered_set<int64_t> wanted;
  osmium::io::Reader ways(file, osmium::osm_entity_bits::way);
  while (const osmium::memory::Buffer buffer = ways.read()) {
    for (const osmium::Way& way : buffer.select<osmium::Way>()) {
      OsmTags tags = tags_of(way);
      std::vector<OsmWay>* const ways_like_it = ways_for(out, tags, with_trams);
      if (ways_like_it == nullptr) continue;
      OsmWay& taken = ways_like_it->emplace_back(OsmWay{way.id(), {}, std::move(tags)});
      for (const osmium::NodeRef& node : way.nodes()) taken.nodes.push_back(node.ref());
      wanted.insert(taken.nodes.begin(), taken.nodes.end());
    }
  }
  ways.close();
  osmium::io::Reader nodes(file, osmium::osm_entity_bits::node);
  while (const osmium::memory::Buffer buffer = nodes.read()) {
    for (const osmium::Node& node : buffer.select<osmium::Node>()) {
      if (!wanted.contains(node.id()) || !node.location().valid()) continue;
      out.nodes[node.id()] = {{node.location().lat(), node.location().lon()}, tags_of(node)};
    }
  }
  nodes.close();
  return out;
}

}  // namespace

bool is_track(const OsmTags& tags, bool with_trams) {
  const auto railway = tags.find("railway");
  if (railway == tags.end()) return false;
  const std::string& kind = railway->second;
  return kind == "rail" || kind == "light_rail" || kind == "narrow_gauge" || kind == "subway" ||
         (with_trams && kind == "tram");
}

std::string value_of(const OsmTags& tags, const char* key) {
  const auto found = tags.find(key);
  return found == tags.end() ? std::string() : found->second;
}

bool is_set(const OsmTags& tags, const char* key) {
  const std::string value = value_of(tags, key);
  return !value.empty() && value != "no";
}

bool leads_over(const OsmTags& tags, bool with_trams) {
  if (is_track(tags, with_trams) || !is_set(tags, "bridge")) return false;
  // What was, or is not yet: nobody knows whether its bridge stands.
  constexpr std::array kGone{"abandoned", "razed", "dismantled", "proposed", "construction"};
  const auto stands = [&](const char* key) {
    return is_set(tags, key) && std::find(kGone.begin(), kGone.end(), value_of(tags, key)) == kGone.end();
  };
  return stands("highway") || stands("railway") || stands("waterway");
}

std::vector<OsmWay>* ways_for(OsmData& data, const OsmTags& tags, bool with_trams) {
  if (is_track(tags, with_trams)) return &data.ways;
  return leads_over(tags, with_trams) ? &data.bridges : nullptr;
}

core::Result<OsmData> read_osm(const std::filesystem::path& file, bool with_trams) {
  try {
    return read_two_passes(file.string(), with_trams);
  } catch (const std::exception& reason) {
    return core::Error{"cannot read " + file.string() + " as OpenStreetMap data: " + reason.what()};
  }
}

}  // namespace railfix::track
