#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>

#include "core/json_text.hpp"
#include "core/whole_file.hpp"
#include "track/import/osm_data.hpp"

namespace railfix::track {
namespace {

using nlohmann::json;

OsmTags tags_in(const json& object, const char* key) {
  OsmTags tags;
  const auto found = object.find(key);
  if (found == object.end() || !found->is_object()) return tags;
  for (const auto& [name, value] : found->items()) {
    if (value.is_string()) tags.emplace(name, value.get<std::string>());
  }
  return tags;
}

bool plausible(const GeoPoint& place) {
  return std::abs(place.lat_deg) <= 90.0 && std::abs(place.lon_deg) <= 180.0;
}

std::map<int64_t, OsmTags> platform_outlines(const json& elements, bool with_trams) {
  std::map<int64_t, OsmTags> out;
  for (const json& element : elements) {
    if (element.value("type", "") != "relation" || !element.contains("members")) continue;
    const OsmTags tags = tags_in(element, "tags");
    if (!is_platform_relation(tags, with_trams)) continue;
    for (const json& member : element.at("members")) {
      if (member.value("type", "") == "way" && is_outline(member.value("role", "")))
        out.emplace(member.at("ref").get<int64_t>(), tags);
    }
  }
  return out;
}

void read_overpass(const json& elements, bool with_trams, OsmData& out) {
  const std::map<int64_t, OsmTags> outlines = platform_outlines(elements, with_trams);
  for (const json& element : elements) {
    const std::string type = element.value("type", "");
    if (type == "node") {
      const GeoPoint place{element.at("lat").get<double>(), element.at("lon").get<double>()};
      if (plausible(place)) out.nodes[element.at("id").get<int64_t>()] = {place, tags_in(element, "tags")};
    } else if (type == "way") {
      OsmTags tags = tags_in(element, "tags");
      const auto id = element.at("id").get<int64_t>();
      std::vector<OsmWay>* ways = ways_for(out, tags, with_trams);
      if (const auto outline = outlines.find(id); ways == nullptr && outline != outlines.end()) {
        ways = &out.platforms;
        tags = outline->second;
      }
      if (ways == nullptr || !element.contains("nodes")) continue;
      ways->push_back({id, element.at("nodes").get<std::vector<int64_t>>(), std::move(tags)});
    }
  }
}

/// GeoJSON coordinates as a node identity: both to 1e-7 degree, as OpenStreetMap stores them.
int64_t identity(const GeoPoint& place) {
  const auto lat = static_cast<int64_t>(std::llround((place.lat_deg + 90.0) * 1e7));
  const auto lon = static_cast<int64_t>(std::llround((place.lon_deg + 180.0) * 1e7));
  return lat * 3'600'000'001 + lon;
}

GeoPoint place_in(const json& coordinates) {
  return {coordinates.at(1).get<double>(), coordinates.at(0).get<double>()};
}

/// "way/123" -> 123; a number made up (negative) where there is none.
int64_t number_in(const OsmTags& tags, size_t position) {
  const auto id = tags.find("@id");
  const size_t slash = id == tags.end() ? std::string::npos : id->second.find('/');
  if (slash != std::string::npos) {
    const int64_t number = std::strtoll(id->second.c_str() + slash + 1, nullptr, 10);
    if (number > 0) return number;
  }
  return -static_cast<int64_t>(position) - 1;
}

void add_line(const json& coordinates, const OsmTags& tags, std::vector<OsmWay>& ways, OsmData& out) {
  OsmWay way{number_in(tags, ways.size()), {}, tags};
  for (const json& pair : coordinates) {
    const GeoPoint place = place_in(pair);
    if (!plausible(place)) continue;
    way.nodes.push_back(identity(place));
    out.nodes[way.nodes.back()].place = place;
  }
  ways.push_back(std::move(way));
}

/// Keys that say what a line is; with one of them it is no track, unless it is a train's route.
constexpr std::array kOtherThings{"aerialway", "aeroway",          "amenity", "barrier",  "boundary", "building",
                                  "highway",   "landuse",          "leisure", "man_made", "natural",  "pipeline",
                                  "power",     "public_transport", "route",   "telecom",  "waterway"};

/// The first of these keys; empty where the line says nothing of the kind.
std::string other_thing(const OsmTags& tags) {
  const auto* const found =
      std::find_if(kOtherThings.begin(), kOtherThings.end(), [&](const char* key) { return tags.contains(key); });
  return found == kOtherThings.end() ? "" : *found;
}

std::string features_named(size_t count) {
  return std::to_string(count) + (count == 1 ? " line" : " lines");
}

void read_features(const json& features, bool with_trams, OsmData& out) {
  std::map<std::string, size_t> others;
  size_t silent_lines = 0;
  for (const json& feature : features) {
    const OsmTags tags = tags_in(feature, "properties");
    const auto geometry = feature.find("geometry");
    if (geometry == feature.end() || !geometry->is_object() || !geometry->contains("coordinates")) continue;
    const json& coordinates = geometry->at("coordinates");
    const std::string type = geometry->value("type", "");
    if (type == "Point") {
      const GeoPoint place = place_in(coordinates);
      if (plausible(place)) out.nodes[identity(place)] = {place, tags};
      continue;
    }
    if (type == "Polygon" || type == "MultiPolygon") {
      if (!is_platform(tags, with_trams)) continue;
      const json parts = type == "Polygon" ? json::array({coordinates}) : coordinates;
      for (const json& rings : parts) add_line(rings.at(0), tags, out.platforms, out);  // the first is the outline
      continue;
    }
    // A line that does not say what it is, or is a train's route, is taken as track.
    const auto route = tags.find("route");
    const bool train_route = route != tags.end() && (route->second == "train" || route->second == "railway");
    const std::string other = other_thing(tags);
    const bool silent = !tags.contains("railway") && !tags.contains("@id") && other.empty();
    std::vector<OsmWay>* ways = ways_for(out, tags, with_trams);
    if (ways == nullptr && (train_route || silent)) ways = &out.ways;
    if (ways == nullptr) {
      if (!other.empty()) ++others[other];
      continue;
    }
    if (silent) ++silent_lines;
    if (type == "LineString") add_line(coordinates, tags, *ways, out);
    if (type == "MultiLineString") {
      for (const json& line : coordinates) add_line(line, tags, *ways, out);
    }
  }
  for (const auto& [key, count] : others)
    out.problems.push_back(features_named(count) + " with \"" + key + "\" and no railway: no track, left out");
  if (silent_lines > 0)
    out.problems.push_back(features_named(silent_lines) + " without a word of what it is: taken as track");
}

}  // namespace

core::Result<OsmData> read_osm_json(const std::filesystem::path& file, bool with_trams) {
  const auto wrong = [&](const std::string& why) {
    return core::Error{"cannot read " + file.string() + " as JSON map data: " + why};
  };
  const auto text = core::read_whole(file);
  if (!text.ok()) return text.error();
  const auto parsed = core::parse_json(text.value());
  if (!parsed.ok()) return wrong(parsed.error().message);
  try {
    const json& document = parsed.value();
    OsmData out;
    if (document.is_object() && document.contains("elements")) {
      read_overpass(document.at("elements"), with_trams, out);
    } else if (document.is_object() && document.contains("features")) {
      read_features(document.at("features"), with_trams, out);
    } else {
      return core::Error{file.string() + " is neither Overpass JSON (\"elements\") nor GeoJSON (\"features\")"};
    }
    return out;
  } catch (const json::exception& reason) {
    return wrong(reason.what());
  }
}

}  // namespace railfix::track
