#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>

#include "core/json_text.hpp"
#include "core/whole_file.hpp"
#include "track/import/osm/osm_bounds.hpp"
#include "track/import/osm/osm_data.hpp"
#include "track/import/osm/osm_feature_tags.hpp"
#include "track/import/swapped.hpp"

namespace railfix::track {
namespace {

using nlohmann::json;

constexpr size_t kMostOfRemark = 200;

/// Beginning of a value, for a message; in ASCII, so that no letter is cut in two.
std::string text_of(const json& value, size_t most = 60) {
  const std::string text = value.dump(-1, ' ', true);
  return text.size() > most ? text.substr(0, most) + "..." : text;
}

const json& member(const json& object, const char* key) {
  const auto found = object.find(key);
  if (found == object.end()) throw core::BadInput("there is no \"" + std::string(key) + "\"");
  return *found;
}

double degrees_in(const json& value) {
  if (!value.is_number()) throw core::BadInput(text_of(value) + " is not a number of degrees");
  return value.get<double>();
}

int64_t id_in(const json& value) {
  if (!value.is_number_integer()) throw core::BadInput(text_of(value) + " is not an id; ids are whole numbers");
  return value.get<int64_t>();
}

/// "way 7", or its number in the list where it does not say that; features too.
std::string called(const json& element, size_t position) {
  const auto as_text = [&](const char* key) {
    const auto found = element.is_object() ? element.find(key) : element.end();
    return found == element.end() ? "" : found->is_string() ? found->get<std::string>() : text_of(*found);
  };
  const std::string id = as_text("id");
  const std::string type = as_text("type");
  if (!id.empty() && !type.empty()) return type + " " + id;
  return (type.empty() ? "element " : type + " ") + std::to_string(position + 1) + " of the file";
}

/// What is wrong within one element names it.
template <class Read>
void for_each_element(const json& elements, const Read& read) {
  for (size_t i = 0; i < elements.size(); ++i) {
    try {
      read(elements[i]);
    } catch (const std::exception& reason) {
      throw core::BadInput(called(elements[i], i) + ": " + reason.what());
    }
  }
}

std::map<int64_t, OsmTags> platform_outlines(const json& elements, bool with_trams) {
  std::map<int64_t, OsmTags> out;
  for_each_element(elements, [&](const json& element) {
    if (element.value("type", "") != "relation" || !element.contains("members")) return;
    const OsmTags tags = tags_in(element, "tags");
    if (!is_platform_relation(tags, with_trams)) return;
    for (const json& part : element.at("members")) {
      if (part.value("type", "") == "way" && is_outline(part.value("role", "")))
        out.emplace(id_in(member(part, "ref")), tags);
    }
  });
  return out;
}

GeoPoint place_of(const json& lat_lon) {
  return {degrees_in(member(lat_lon, "lat")), degrees_in(member(lat_lon, "lon"))};
}

/// Of a way; `out geom;` writes the places into it ("geometry", null where they were cut off) and the nodes may then be
/// nowhere else.
std::vector<int64_t> nodes_of(const json& way, OsmData& out, NodesNowhere& nowhere) {
  std::vector<int64_t> nodes;
  const auto ids = way.find("nodes");
  const bool has_ids = ids != way.end();
  if (has_ids) {
    for (const json& id : *ids) nodes.push_back(id_in(id));
  }
  const auto geometry = way.find("geometry");
  if (geometry == way.end()) return nodes;
  if (has_ids && geometry->size() != nodes.size())
    throw core::BadInput("it has " + std::to_string(nodes.size()) + " nodes but " + std::to_string(geometry->size()) +
                         " places in its geometry");
  constexpr int64_t kNowhere = -1;  // breaks the line, as a node does that is missing
  for (size_t i = 0; i < geometry->size(); ++i) {
    const json& lat_lon = (*geometry)[i];
    const std::optional<GeoPoint> place = lat_lon.is_null() ? std::nullopt : std::optional(place_of(lat_lon));
    const bool is_there = place && is_on_earth(*place);
    if (place && !is_there) nowhere.add(*place);
    if (!has_ids) nodes.push_back(is_there ? id_of_place(*place) : kNowhere);
    if (is_there) out.nodes.try_emplace(nodes[i], OsmNode{*place, {}});
  }
  return nodes;
}

void read_overpass(const json& elements, bool with_trams, OsmData& out) {
  const std::map<int64_t, OsmTags> outlines = platform_outlines(elements, with_trams);
  std::unordered_map<int64_t, GeoPoint> elsewhere;  // nodes of anything
  NodesNowhere nowhere;
  for_each_element(elements, [&](const json& element) {
    const std::string type = element.value("type", "");
    if (type == "node") {
      const GeoPoint place = place_of(element);
      if (is_on_earth(place)) {
        out.nodes[id_in(member(element, "id"))] = {place, tags_in(element, "tags")};
      } else {
        elsewhere[id_in(member(element, "id"))] = place;
      }
    } else if (type == "way") {
      OsmTags tags = tags_in(element, "tags");
      const int64_t id = id_in(member(element, "id"));
      std::vector<OsmWay>* ways = ways_for(out, tags, with_trams);
      if (const auto outline = outlines.find(id); ways == nullptr && outline != outlines.end()) {
        ways = &out.platforms;
        tags = outline->second;
      }
      if (ways != nullptr) ways->push_back({id, nodes_of(element, out, nowhere), std::move(tags)});
    }
  });
  for (const OsmWay& way : out.ways) {
    for (const int64_t node : way.nodes) {
      if (const auto place = elsewhere.find(node); place != elsewhere.end()) nowhere.add(place->second);
    }
  }
  nowhere.tell(out.problems);
}

GeoPoint place_in(const json& coordinates) {
  if (!coordinates.is_array() || coordinates.size() < 2)
    throw core::BadInput(text_of(coordinates) + " is no pair of longitude and latitude");
  return {degrees_in(coordinates[1]), degrees_in(coordinates[0])};
}

/// "way/123" -> 123; a number made up (negative) where there is none.
int64_t number_in(const OsmTags& tags, size_t position) {
  const std::string id = value_of(tags, "@id");
  const int64_t number = id.starts_with("way/") ? std::strtoll(id.c_str() + 4, nullptr, 10) : 0;
  return number > 0 ? number : -static_cast<int64_t>(position) - 1;
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

/// A GeoJSON "bbox": west, south, east, north, with a height behind each pair or none. Nothing where it is none.
std::optional<OsmBounds> bounds_in(const json& document) {
  const auto box = document.find("bbox");
  if (box == document.end() || !box->is_array() || (box->size() != 4 && box->size() != 6)) return std::nullopt;
  if (!std::all_of(box->begin(), box->end(), [](const json& value) { return value.is_number(); })) return std::nullopt;
  return OsmBounds{place_in(*box), place_in(json::array({box->at(box->size() / 2), box->at(box->size() / 2 + 1)}))};
}

class FeatureReader {
 public:
  FeatureReader(bool with_trams, OsmData& out) : with_trams_(with_trams), out_(out) {}

  void read(const json& features) {
    for_each_element(features, [&](const json& feature) {
      ++number_;
      const auto geometry = feature.find("geometry");
      const bool has_place = geometry != feature.end() && geometry->is_object() && geometry->contains("coordinates");
      const OsmTags tags = feature_tags(feature);
      if (!has_place) return tell_without_line(tags);
      add(tags, geometry->value("type", ""), geometry->at("coordinates"));
    });
    if (on_earth_ == 0 && !elsewhere_.empty()) {
      throw core::BadInput(elsewhere_ + "; GeoJSON coordinates are longitude, latitude in degrees (WGS 84)" +
                           (swapped_ ? "" : ": convert them, for example by ogr2ogr -t_srs EPSG:4326"));
    }
    for (const auto& [key, count] : others_)
      out_.problems.push_back(features_named(count) + " with \"" + key + "\" and no railway: no track, left out");
    if (without_line_ > 0)
      out_.problems.push_back(std::to_string(without_line_) +
                              " features are railway tracks by their tags but have no line; left out: export the ways "
                              "with their geometry");
    if (with_height_ > 0)
      out_.problems.push_back(features_named(with_height_) + " with heights, as third coordinates: these are not read");
    if (silent_lines_ > 0)
      out_.problems.push_back(features_named(silent_lines_) + " without a word of what it is: taken as track");
  }

 private:
  void tell_without_line(const OsmTags& tags) {
    if (is_track(tags, with_trams_)) ++without_line_;
  }

  void add(const OsmTags& tags, const std::string& type, const json& coordinates) {
    const bool is_line = type == "LineString" || (type == "MultiLineString" && !coordinates.empty());
    if (!is_line) tell_without_line(tags);
    if (type == "Point") {
      const GeoPoint place = place_in(coordinates);
      if (takes(place)) {
        out_.nodes[id_of_place(place)] = {place, tags};
      } else {
        tell_elsewhere(1, coordinates, "");
      }
    } else if (type == "Polygon" || type == "MultiPolygon") {
      if (!is_platform(tags, with_trams_)) return;
      const json parts = type == "Polygon" ? json::array({coordinates}) : coordinates;
      for (const json& rings : parts) add_line(rings.at(0), tags, out_.platforms);  // the first is the outline
    } else if (std::vector<OsmWay>* ways = ways_of_line(tags)) {
      if (type == "LineString") add_line(coordinates, tags, *ways);
      if (type == "MultiLineString") {
        for (const json& line : coordinates) add_line(line, tags, *ways);
      }
    }
  }

  /// A line that does not say what it is, or is a train's route, is taken as track.
  std::vector<OsmWay>* ways_of_line(const OsmTags& tags) {
    const auto route = tags.find("route");
    const bool train_route = route != tags.end() && (route->second == "train" || route->second == "railway");
    const std::string other = other_thing(tags);
    const bool silent = !tags.contains("railway") && !tags.contains("@id") && other.empty();
    std::vector<OsmWay>* ways = ways_for(out_, tags, with_trams_);
    if (ways == nullptr && (train_route || silent)) ways = &out_.ways;
    if (ways == nullptr && !other.empty()) ++others_[other];
    if (ways != nullptr && silent) ++silent_lines_;
    return ways;
  }

  void add_line(const json& coordinates, const OsmTags& tags, std::vector<OsmWay>& ways) {
    OsmWay way{number_in(tags, ways.size()), {}, tags};
    if (std::ranges::any_of(coordinates, [](const json& place) { return place.size() > 2; })) ++with_height_;
    size_t elsewhere = 0;
    const json* first_elsewhere = nullptr;
    for (const json& pair : coordinates) {
      const GeoPoint place = place_in(pair);
      if (takes(place)) {
        way.nodes.push_back(id_of_place(place));
        out_.nodes[way.nodes.back()].place = place;
      } else if (++elsewhere == 1) {
        first_elsewhere = &pair;
      }
    }
    if (elsewhere > 0) tell_elsewhere(elsewhere, *first_elsewhere, ", way/" + std::to_string(way.id));
    ways.push_back(std::move(way));
  }

  bool takes(const GeoPoint& place) {
    if (!is_on_earth(place)) return false;
    ++on_earth_;
    return true;
  }

  void tell_elsewhere(size_t count, const json& first, const std::string& way) {
    const bool is_swapped = may_be_swapped(place_in(first));
    const std::string told =
        "feature " + std::to_string(number_) + way + ": the coordinates " + text_of(first) +
        (count > 1 ? " and " + std::to_string(count - 1) + " more" : "") +
        (is_swapped ? std::string(" have a latitude beyond 90 degrees, ") + kMayBeSwapped : " are not degrees");
    if (elsewhere_.empty()) {
      elsewhere_ = told;
      swapped_ = is_swapped;
    }
    out_.problems.push_back(told + "; left out");
  }

  bool with_trams_;
  OsmData& out_;
  size_t number_ = 0;  // of the feature that is read, from 1
  std::map<std::string, size_t> others_;
  size_t silent_lines_ = 0;
  size_t without_line_ = 0;
  size_t with_height_ = 0;
  size_t on_earth_ = 0;
  std::string elsewhere_;  // the first time that a point was not
  bool swapped_ = false;   // it would be, the other way round
};

}  // namespace

int64_t id_of_place(const GeoPoint& place) {
  const auto lat = static_cast<int64_t>(std::llround((place.lat_deg + 90.0) * 1e7));
  const auto lon = static_cast<int64_t>(std::llround((place.lon_deg + 180.0) * 1e7));
  return lat * 3'600'000'001 + lon;
}

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
      if (!document.at("elements").is_array()) return wrong("its \"elements\" are no list");
      if (document.contains("remark"))
        out.problems.push_back(problem_of_remark(text_of(document.at("remark"), kMostOfRemark)));
      read_overpass(document.at("elements"), with_trams, out);
    } else if (document.is_object() && document.contains("features")) {
      FeatureReader(with_trams, out).read(document.at("features"));
      if (const std::optional<OsmBounds> declared = bounds_in(document)) tell_contradiction(*declared, out);
    } else {
      return core::Error{file.string() + " is neither Overpass JSON (\"elements\") nor GeoJSON (\"features\")"};
    }
    return out;
  } catch (const std::exception& reason) {
    return wrong(reason.what());
  }
}

}  // namespace railfix::track
