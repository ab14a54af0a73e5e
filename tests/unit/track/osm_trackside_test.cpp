// What stands beside the tracks of OpenStreetMap: the ends of platforms, and masts.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <osmium/builder/attr.hpp>
#include <osmium/io/any_output.hpp>
#include <tuple>

#include "core/units.hpp"
#include "import_fixture.hpp"
#include "track/import/build.hpp"
#include "track/import/osm/osm_data.hpp"

namespace railfix::track {
namespace {

using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;

constexpr double kLatDeg = 48.2;
constexpr double kLonDeg = 15.6;
constexpr double kNorthRadiusM = 6'370'994;  // of curvature, there
constexpr double kEastRadiusM = 6'390'033;

struct Way {
  std::vector<std::pair<double, double>> places;  // metres east and north
  OsmTags tags;
};

/// Two tracks that run east, 10 m from each other, 1000 m long; the southern one is cut by a switch at 500 m.
std::vector<Way> two_tracks() {
  return {{{{0, 0}, {500, 0}}, {{"railway", "rail"}, {"name", "south"}}},
          {{{500, 0}, {1000, 0}}, {{"railway", "rail"}, {"name", "south"}}},
          {{{500, 0}, {600, -12}, {700, -40}}, {{"railway", "rail"}, {"service", "siding"}}},
          {{{0, 10}, {1000, 10}}, {{"railway", "rail"}, {"name", "north"}}}};
}

/// Says no more than that it is one.
OsmTags plain_platform() {
  OsmTags tags;
  tags["railway"] = "platform";
  return tags;
}

std::vector<Way> with(std::vector<Way> ways, const std::vector<Way>& more) {
  ways.insert(ways.end(), more.begin(), more.end());
  return ways;
}

std::vector<std::pair<double, double>> box(double west, double south, double east, double north) {
  return {{west, south}, {east, south}, {east, north}, {west, north}, {west, south}};
}

class OsmTracksideTest : public ImportTest {
 protected:
  static std::pair<double, double> lon_lat(const std::pair<double, double>& at) {
    const double lat = kLatDeg + core::deg_from_rad(at.second / kNorthRadiusM);
    return {kLonDeg + core::deg_from_rad(at.first / kEastRadiusM / std::cos(core::rad_from_deg(kLatDeg))), lat};
  }

  static std::string tags_json(const OsmTags& tags) {
    std::string out;
    for (const auto& [key, value] : tags) out += (out.empty() ? "\"" : ",\"") + key + "\":\"" + value + "\"";
    return "{" + out + "}";
  }

  /// `more` = further elements, each with a comma before it. Way i has the number 1000 + i.
  [[nodiscard]] std::filesystem::path overpass(const std::vector<Way>& ways, const std::string& more = "") const {
    std::map<std::pair<double, double>, int> nodes;
    std::string out;
    for (size_t i = 0; i < ways.size(); ++i) {
      std::string refs;
      for (const auto& place : ways[i].places) {
        const auto [entry, is_new] = nodes.try_emplace(place, static_cast<int>(nodes.size()) + 1);
        refs += (refs.empty() ? "" : ",") + std::to_string(entry->second);
      }
      out += ",{\"type\":\"way\",\"id\":" + std::to_string(1000 + i) + ",\"nodes\":[" + refs +
             "],\"tags\":" + tags_json(ways[i].tags) + "}";
    }
    for (const auto& [place, id] : nodes) {
      const auto [lon, lat] = lon_lat(place);
      char text[120];
      std::snprintf(text, sizeof text, ",{\"type\":\"node\",\"id\":%d,\"lat\":%.9f,\"lon\":%.9f}", id, lat, lon);
      out += text;
    }
    return write("a.json", "{\"elements\":[" + (out + more).substr(1) + "]}");
  }

  [[nodiscard]] std::filesystem::path geojson(const std::vector<Way>& ways) const {
    std::string out;
    for (const Way& way : ways) {
      std::string places;
      for (const auto& place : way.places) {
        const auto [lon, lat] = lon_lat(place);
        char text[60];
        std::snprintf(text, sizeof text, ",[%.7f,%.7f]", lon, lat);
        places += text;
      }
      const bool is_ring = way.places.front() == way.places.back();
      places = "[" + places.substr(1) + "]";
      out += ",{\"type\":\"Feature\",\"properties\":" + tags_json(way.tags) + R"(,"geometry":{"type":")" +
             (is_ring ? "Polygon" : "LineString") + "\",\"coordinates\":" + (is_ring ? "[" + places + "]" : places) +
             "}}";
    }
    return write("a.geojson", R"({"type":"FeatureCollection","features":[)" + out.substr(1) + "]}");
  }

  static osmium::memory::Buffer buffer_of(const std::vector<Way>& ways) {
    using namespace osmium::builder::attr;  // NOLINT(google-build-using-namespace)
    osmium::memory::Buffer buffer(100000, osmium::memory::Buffer::auto_grow::yes);
    std::map<std::pair<double, double>, osmium::object_id_type> nodes;
    for (const Way& way : ways) {
      for (const auto& place : way.places) {
        const auto [entry, is_new] = nodes.try_emplace(place, static_cast<osmium::object_id_type>(nodes.size()) + 1);
        const auto [lon, lat] = lon_lat(place);
        if (is_new) osmium::builder::add_node(buffer, _id(entry->second), _version(1), _location(lon, lat));
      }
    }
    for (size_t i = 0; i < ways.size(); ++i) {
      std::vector<osmium::object_id_type> refs;
      for (const auto& place : ways[i].places) refs.push_back(nodes.at(place));
      osmium::builder::add_way(buffer, _id(static_cast<osmium::object_id_type>(1000 + i)), _version(1), _nodes(refs),
                               _tags(ways[i].tags));
    }
    return buffer;
  }
  [[nodiscard]] std::filesystem::path written(const std::string& name, osmium::memory::Buffer&& buffer) const {
    osmium::io::Writer writer(in_folder(name).string(), osmium::io::overwrite::allow);
    writer(std::move(buffer));
    writer.close();
    return in_folder(name);
  }

  /// "NAME LINE METRES left|right" of every end of a platform, metres from the west, in the order of the map.
  static std::vector<std::string> platform_ends(const std::filesystem::path& file) {
    return ends_of(core::value_or_throw(build_map({file}, {.crs = "local"})).map);
  }
  static std::vector<std::string> ends_of(const Map& map) {
    const auto west = map.from_geo({kLatDeg, kLonDeg});
    std::vector<std::string> out;
    for (const Landmark& mark : map.landmarks) {
      if (mark.kind != LandmarkKind::platform) continue;
      const Edge& edge = *map.edge(mark.edge);
      const PlanPose pose = edge.alignment.at(mark.offset_m).pose;
      // Half as good as drawn at the best: the end of an edge slopes down.
      EXPECT_GT(mark.sigma_m, 4);
      EXPECT_LT(mark.sigma_m, 8);
      EXPECT_NEAR(std::abs(mark.lateral_m), 1.7, 0.01);
      const bool runs_east = std::sin(pose.heading_rad) > 0;
      char text[120];
      std::snprintf(text, sizeof text, "%s %s %.0f %s", mark.name.c_str(), edge.line.c_str(),
                    pose.easting_m - west->x(), (mark.lateral_m > 0) == runs_east ? "left" : "right");
      out.emplace_back(text);
    }
    std::sort(out.begin(), out.end());
    return out;
  }
};

TEST_F(OsmTracksideTest, AnAreaBetweenTwoTracksHasAnEdgeBesideEach) {
  const std::vector<Way> ways =
      with(two_tracks(), {{box(100, 1.8, 250, 8.3), {{"railway", "platform"}, {"name", "P"}}}});
  for (const auto& file : {overpass(ways), geojson(ways)}) {
    SCOPED_TRACE(file.filename().string());
    EXPECT_THAT(platform_ends(file),
                ElementsAre("P north 100 right", "P north 250 right", "P south 100 left", "P south 250 left"));
  }
}

TEST_F(OsmTracksideTest, AnAreaBesideOneTrackIsNotBesideTheNext) {
  const auto side = with(two_tracks(), {{box(100, -5, 250, -1.5), {{"railway", "platform"}, {"ref", "1"}}}});
  EXPECT_THAT(platform_ends(overpass(side)), ElementsAre("1 south 100 right", "1 south 250 right"));
}

// The edge says where it is and what it is called; the area around it says the same once more, coarser.
TEST_F(OsmTracksideTest, AnEdgeIsBetterThanTheArea) {
  const auto ways = with(two_tracks(), {{box(96, 1.9, 255, 8.3), {{"railway", "platform"}, {"name", "P"}}},
                                        {{{100, 1.7}, {250, 1.7}}, {{"railway", "platform_edge"}, {"ref", "7"}}}});
  EXPECT_THAT(platform_ends(overpass(ways)),
              ElementsAre("7 south 100 left", "7 south 250 left", "P north 255 right", "P north 96 right"));
}

TEST_F(OsmTracksideTest, ALineIsTheMiddleOrTheEdge) {
  const OsmTags tags{{"public_transport", "platform"}, {"train", "yes"}};
  EXPECT_THAT(platform_ends(overpass(with(two_tracks(), {{{{100, 5.2}, {250, 5.2}}, tags}}))),
              ElementsAre(" north 100 right", " north 250 right", " south 100 left", " south 250 left"));
  EXPECT_THAT(platform_ends(overpass(with(two_tracks(), {{{{250, 2}, {100, 2}}, tags}}))),
              ElementsAre(" south 100 left", " south 250 left"));
  // Not quite along the tracks, far from where their points are.
  EXPECT_THAT(platform_ends(overpass(with(two_tracks(), {{{{750, 5.2}, {800, 5.7}, {850, 5.2}}, tags}}))),
              ElementsAre(" north 750 right", " north 850 right", " south 750 left", " south 850 left"));
}

// The southern track is two edges, cut by a switch: a platform beside both has two ends all the same.
TEST_F(OsmTracksideTest, APlatformPastASwitchEndsOnceOnEitherSide) {
  const OsmTags tags = plain_platform();
  EXPECT_THAT(platform_ends(overpass(with(two_tracks(), {{box(400, 1.7, 600, 5), tags}}))),
              ElementsAre(" south 400 left", " south 600 left"));
  EXPECT_THAT(platform_ends(overpass(with(two_tracks(), {{box(400, 1.7, 508, 5), tags}}))),
              ElementsAre(" south 400 left", " south 508 left"));
  // Two parts, drawn one behind the other, are one.
  EXPECT_THAT(
      platform_ends(overpass(with(two_tracks(), {{box(100, 1.7, 180, 5), tags}, {box(182, 1.7, 250, 5), tags}}))),
      ElementsAre(" south 100 left", " south 250 left"));
}

TEST_F(OsmTracksideTest, BeyondTheEndOfTheTrackNobodySeesAnEnd) {
  EXPECT_THAT(platform_ends(overpass(with(two_tracks(), {{box(900, 1.7, 1020, 5), plain_platform()}}))),
              ElementsAre(" south 900 left"));
}

TEST_F(OsmTracksideTest, WhatIsNotBesideTheTrackIsLeftOut) {
  for (const OsmTags& tags : std::initializer_list<OsmTags>{{{"public_transport", "platform"}, {"bus", "yes"}},
                                                            {{"railway", "platform"}, {"tram", "yes"}},
                                                            {{"railway", "platform"}, {"disused", "yes"}},
                                                            {{"highway", "platform"}, {"bus", "yes"}}}) {
    EXPECT_TRUE(platform_ends(overpass(with(two_tracks(), {{box(100, 1.8, 250, 4), tags}}))).empty());
  }
  for (const OsmTags& tags : std::initializer_list<OsmTags>{{{"railway", "platform"}, {"layer", "-2"}},
                                                            {{"railway", "platform"}, {"level", "-1"}},
                                                            {{"railway", "platform"}, {"layer", "1"}}}) {
    const Map map = core::value_or_throw(
                        build_map({overpass(with(two_tracks(), {{box(100, 1.8, 250, 4), tags}}))}, {.crs = "local"}))
                        .map;
    EXPECT_TRUE(ends_of(map).empty());
    EXPECT_THAT(map.problems, Contains("1 of 1 platforms lie beside no track; left out"));
  }
  const auto across =
      with(two_tracks(), {{box(300, -40, 304, 40), plain_platform()}, {box(100, -30, 250, -20), plain_platform()}});
  EXPECT_TRUE(platform_ends(overpass(across)).empty());
}

TEST_F(OsmTracksideTest, AGeoJsonLineOfAPlatformIsNoTrack) {
  const auto ways = with(two_tracks(), {{{{100, 30}, {250, 30}}, {{"public_transport", "platform"}}}});
  const Map map = core::value_or_throw(build_map({geojson(ways)}, {.crs = "local"})).map;
  EXPECT_EQ(map.edges.size(), 4U);
}

// A platform with a hole is a relation; its ways say nothing themselves.
TEST_F(OsmTracksideTest, AMultipolygonIsReadInEveryFormat) {
  const auto ways = with(two_tracks(), {{box(100, 1.8, 250, 8.2), {}}, {box(150, 4, 160, 6), {}}});
  const auto json = overpass(ways, R"(,{"type":"relation","id":1,"tags":{"type":"multipolygon","railway":"platform",
"name":"P"},"members":[{"type":"way","ref":1004,"role":"outer"},{"type":"way","ref":1005,"role":"inner"}]})");
  const std::vector<std::string> expected{"P north 100 right", "P north 250 right", "P south 100 left",
                                          "P south 250 left"};
  EXPECT_EQ(platform_ends(json), expected);

  for (const char* name : {"a.osm", "a.osm.pbf"}) {
    SCOPED_TRACE(name);
    using namespace osmium::builder::attr;  // NOLINT(google-build-using-namespace)
    osmium::memory::Buffer buffer = buffer_of(ways);
    osmium::builder::add_relation(
        buffer, _id(1), _version(1), _tag("type", "multipolygon"), _tag("railway", "platform"), _tag("name", "P"),
        _member(osmium::item_type::way, 1004, "outer"), _member(osmium::item_type::way, 1005, "inner"));
    EXPECT_EQ(platform_ends(written(name, std::move(buffer))), expected);
  }
}

/// "REF LINE METRES to the left" of every mast.
std::vector<std::string> masts_of(const Map& map) {
  std::vector<std::string> out;
  for (const Landmark& mark : map.landmarks) {
    if (mark.kind != LandmarkKind::mast) continue;
    EXPECT_NEAR(mark.sigma_m, 3, 0.01);
    const Edge& edge = *map.edge(mark.edge);
    const bool runs_east = std::sin(edge.alignment.at(mark.offset_m).pose.heading_rad) > 0;
    char text[120];
    std::snprintf(text, sizeof text, "%s %s %.1f", mark.name.c_str(), edge.line.c_str(),
                  runs_east ? mark.lateral_m : -mark.lateral_m);
    out.emplace_back(text);
  }
  std::sort(out.begin(), out.end());
  return out;
}

// They are nodes beside the ways. One in the middle carries the wires of both.
TEST_F(OsmTracksideTest, MastsStandBesideTheNearestTracks) {
  const std::vector<std::tuple<int, double, double>> masts{{90, 200, -3}, {91, 300, 5}, {92, 400, 13.2}, {93, 300, 40}};
  std::string json;
  std::string features;
  for (const auto& [id, east_m, north_m] : masts) {
    const auto [lon, lat] = lon_lat({east_m, north_m});
    char text[300];
    std::snprintf(text, sizeof text,
                  R"(,{"type":"node","id":%d,"lat":%.9f,"lon":%.9f,"tags":{"power":"catenary_mast","ref":"%d"}})", id,
                  lat, lon, id);
    json += text;
    std::snprintf(text, sizeof text,
                  R"(,{"type":"Feature","properties":{"power":"catenary_mast","ref":"%d"},)"
                  R"("geometry":{"type":"Point","coordinates":[%.7f,%.7f]}})",
                  id, lon, lat);
    features += text;
  }
  std::string geo = content(geojson(two_tracks()));
  geo.insert(geo.rfind("]}"), features);
  osmium::memory::Buffer buffer = buffer_of(two_tracks());
  using namespace osmium::builder::attr;  // NOLINT(google-build-using-namespace)
  for (const auto& [id, east_m, north_m] : masts) {
    const auto [lon, lat] = lon_lat({east_m, north_m});
    osmium::builder::add_node(buffer, _id(id), _version(1), _location(lon, lat), _tag("power", "catenary_mast"),
                              _tag("ref", std::to_string(id).c_str()));
  }
  for (const auto& file :
       {overpass(two_tracks(), json), write("b.geojson", geo), written("a.osm.pbf", std::move(buffer))}) {
    SCOPED_TRACE(file.filename().string());
    const Map map = core::value_or_throw(build_map({file}, {.crs = "local"})).map;
    EXPECT_THAT(masts_of(map), ElementsAre("90 south -3.0", "91 north -5.0", "91 south 5.0", "92 north 3.2"));
    EXPECT_THAT(map.problems, Contains("1 of the catenary masts stand beside no track; left out"));
  }
}

TEST_F(OsmTracksideTest, StopPositionsAloneAreTold) {
  const Map map =
      core::value_or_throw(build_map({overpass(two_tracks(), R"(,{"type":"node","id":99,"lat":48.2,"lon":15.602,
"tags":{"railway":"stop","public_transport":"stop_position"}})")},
                                     {.crs = "local"}))
          .map;
  EXPECT_THAT(map.problems, Contains(HasSubstr("1 stop positions and no platform")));
}

TEST_F(OsmTracksideTest, VentimigliaHasStopsAndNoPlatforms) {
  const std::filesystem::path file = shared_data("network/osm/Ventimiglia_Albenga.geojson");
  if (!std::filesystem::exists(file)) GTEST_SKIP() << "skipped: no " << file;
  const Map map = core::value_or_throw(build_map({file}, {})).map;
  EXPECT_TRUE(ends_of(map).empty());
  EXPECT_THAT(map.problems, Contains(HasSubstr("16 stop positions and no platform")));
}

}  // namespace
}  // namespace railfix::track
