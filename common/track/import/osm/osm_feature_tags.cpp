#include "track/import/osm/osm_feature_tags.hpp"

#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>

#include "core/json_text.hpp"

namespace railfix::track {
namespace {

using nlohmann::json;

/// As OpenStreetMap says it: converters make numbers and booleans of what are strings there, and 1.0 of 1.
std::optional<std::string> tag_of(const json& value) {
  constexpr double kMostWhole = 1e15;
  if (value.is_string()) return value.get<std::string>();
  if (value.is_boolean()) return value.get<bool>() ? "yes" : "no";
  if (!value.is_number()) return std::nullopt;
  const double number = value.get<double>();
  const bool is_whole = value.is_number_float() && std::abs(number) < kMostWhole && number == std::floor(number);
  return is_whole ? std::to_string(static_cast<int64_t>(number)) : value.dump();
}

/// The next text in quotation marks, which may hold \" and \\; `at` is behind it then. Nothing where there is none.
std::optional<std::string> quoted(const std::string& text, size_t& at) {
  at = text.find('"', at);
  if (at == std::string::npos) return std::nullopt;
  std::string out;
  for (++at; at < text.size() && text[at] != '"'; ++at) {
    if (text[at] == '\\') ++at;
    if (at < text.size()) out += text[at];
  }
  if (at >= text.size()) return std::nullopt;
  ++at;
  return out;
}

/// PostgreSQL's hstore: "bridge"=>"yes","layer"=>"1". A value may be NULL.
void unpack_hstore(const std::string& text, OsmTags& tags) {
  for (size_t at = 0;;) {
    const auto key = quoted(text, at);
    if (!key || text.compare(at, 2, "=>") != 0) return;
    at += 2;
    if (text.compare(at, 4, "NULL") == 0) continue;
    auto value = quoted(text, at);
    if (!value) return;
    tags.emplace(*key, std::move(*value));
  }
}

/// What ogr2ogr has no column for.
void unpack_others(OsmTags& tags) {
  for (const char* packed : {"other_tags", "all_tags"}) {
    const std::string text = value_of(tags, packed);
    const auto as_json = text.starts_with('{') ? core::parse_json<json>(text) : json();
    if (as_json.ok() && as_json.value().is_object()) {
      tags.merge(tags_in({{packed, as_json.value()}}, packed));
    } else {
      unpack_hstore(text, tags);
    }
  }
}

/// osmium's "w123".
std::string with_type(const std::string& id) {
  constexpr std::array<std::pair<char, const char*>, 3> kTypes{{{'n', "node/"}, {'w', "way/"}, {'r', "relation/"}}};
  for (const auto& [letter, type] : kTypes) {
    if (id.size() > 1 && id[0] == letter && id.find_first_not_of("0123456789", 1) == std::string::npos)
      return type + id.substr(1);
  }
  return id;
}

std::string id_of(const json& feature, const OsmTags& tags) {
  const std::string id = value_of(tags, "@id");
  const std::string type = value_of(tags, "@type");
  if (!id.empty()) return id.find('/') == std::string::npos && !type.empty() ? type + "/" + id : id;
  const auto own = feature.find("id");
  if (own != feature.end() && own->is_string()) return with_type(own->get<std::string>());
  const std::string osm_id = value_of(tags, "osm_id");
  const auto geometry = feature.find("geometry");
  const bool is_line = geometry != feature.end() && geometry->is_object() &&
                       geometry->value("type", "").find("LineString") != std::string::npos;
  return osm_id.empty() || !is_line ? "" : "way/" + osm_id;
}

}  // namespace

OsmTags tags_in(const json& object, const char* key) {
  OsmTags tags;
  const auto found = object.find(key);
  if (found == object.end() || !found->is_object()) return tags;
  for (const auto& [name, value] : found->items()) {
    if (auto tag = tag_of(value)) tags.emplace(name, std::move(*tag));
  }
  return tags;
}

OsmTags feature_tags(const json& feature) {
  OsmTags tags = tags_in(feature, "properties");
  unpack_others(tags);
  if (std::string id = id_of(feature, tags); !id.empty()) tags.insert_or_assign("@id", std::move(id));
  return tags;
}

}  // namespace railfix::track
