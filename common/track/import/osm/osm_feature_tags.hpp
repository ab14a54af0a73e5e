// The tags of OpenStreetMap elements in JSON, as the programs that write it spell them.
#pragma once

#include <nlohmann/json_fwd.hpp>

#include "track/import/osm/osm_data.hpp"

namespace railfix::track {

/// The members of object[key] that are a text, a number or a boolean.
OsmTags tags_in(const nlohmann::json& object, const char* key);

/// The properties of a GeoJSON feature, those too that ogr2ogr packs into "other_tags" or "all_tags" (as hstore or
/// JSON). "@id" is "way/123" wherever the feature says that: "@id" (overpass-turbo), with "@type" beside a number, an
/// id of its own ("way/123", osmium's "w123"), or "osm_id" of a line (ogr2ogr).
OsmTags feature_tags(const nlohmann::json& feature);

}  // namespace railfix::track
