// Tags that converters to JSON have made numbers and booleans of.
#include "core/units.hpp"
#include "import_fixture.hpp"
#include "track/import/build.hpp"

namespace railfix::track {
namespace {

/// A track to the east: way 1, way 2 in a tunnel, way 3, which a road crosses on a bridge.
struct Tags {
  std::string speed;
  std::string tunnel;
  std::string layer;
  std::string bridge;
};
constexpr const char* kTrue = "true";

class OsmTagsTest : public ImportTest {
 protected:
  [[nodiscard]] static std::string tags_of(int way, const Tags& tags) {
    if (way == 4) return R"("highway":"primary","bridge":)" + tags.bridge + R"(,"layer":)" + tags.layer;
    return R"("railway":"rail","maxspeed":)" + tags.speed + (way == 2 ? R"(,"tunnel":)" + tags.tunnel : "");
  }
  static std::vector<std::pair<double, double>> line(int way) {  // longitude, latitude
    if (way == 4) return {{15.0068, 48.001}, {15.0068, 47.999}};
    std::vector<std::pair<double, double>> out;
    for (int i = 0; i <= 5; ++i) out.emplace_back(15 + 0.003 * (way - 1) + 0.0006 * i, 48);
    return out;
  }

  [[nodiscard]] static std::string geojson(const Tags& tags) {
    std::string features;
    for (int way = 1; way <= 4; ++way) {
      std::string places;
      for (const auto& [lon, lat] : line(way))
        places += (places.empty() ? "[" : ",[") + std::to_string(lon) + "," + std::to_string(lat) + "]";
      features += (way > 1 ? "," : "") + std::string(R"({"type":"Feature","properties":{)") + tags_of(way, tags) +
                  R"(},"geometry":{"type":"LineString","coordinates":[)" + places + "]}}";
    }
    return R"({"type":"FeatureCollection","features":[)" + features + "]}";
  }
  [[nodiscard]] static std::string overpass(const Tags& tags) {
    std::string ways;
    for (int way = 1; way <= 4; ++way) {
      std::string places;
      for (const auto& [lon, lat] : line(way)) {
        places += std::string(places.empty() ? "" : ",") + R"({"lat":)" + std::to_string(lat) + R"(,"lon":)" +
                  std::to_string(lon) + "}";
      }
      ways += (way > 1 ? "," : "") + std::string(R"({"type":"way","id":)") + std::to_string(way) + R"(,"tags":{)" +
              tags_of(way, tags) + R"(},"geometry":[)" + places + "]}";
    }
    return R"({"elements":[)" + ways + "]}";
  }

  [[nodiscard]] Map map_of(const std::string& text) const {
    return core::value_or_throw(build_map({write("a.json", text)}, {})).map;
  }
  [[nodiscard]] std::string bytes_of(const std::string& text) const {
    EXPECT_TRUE(map_of(text).save(in_folder("a.map")).ok());
    return content(in_folder("a.map"));
  }
  static std::vector<std::string> kinds_of(const Map& map) {
    std::vector<std::string> out;
    for (const Landmark& mark : map.landmarks) out.push_back(to_string(mark.kind));
    return out;
  }
};

TEST_F(OsmTagsTest, NumbersAndBooleansAreTheirStrings) {
  const Tags strings{"\"120\"", "\"yes\"", "\"1\"", "\"yes\""};
  for (const Tags& typed : {Tags{"120", kTrue, "1", kTrue}, Tags{"120.0", kTrue, "1.0", kTrue}}) {
    EXPECT_TRUE(bytes_of(geojson(typed)) == bytes_of(geojson(strings)));
    EXPECT_TRUE(bytes_of(overpass(typed)) == bytes_of(overpass(strings)));
  }
  const Map map = map_of(geojson({"120", kTrue, "1", kTrue}));
  EXPECT_THAT(kinds_of(map), testing::UnorderedElementsAre("portal_in", "portal_out", "bridge"));
  EXPECT_NEAR(core::kmh_from_mps(map.edges.at(0).speed_limit_mps(50, Direction::forward).value_or(0)), 120, 1e-9);
  EXPECT_NEAR(
      core::kmh_from_mps(
          map_of(geojson({"62.5", kTrue, "1", kTrue})).edges.at(0).speed_limit_mps(50, Direction::forward).value_or(0)),
      62.5, 1e-9);
}

TEST_F(OsmTagsTest, WhatIsNotSetIsNoTunnel) {
  for (const char* no : {"false", "0", "null", "\"no\"", "\"0\"", "\"false\""}) {
    SCOPED_TRACE(no);
    EXPECT_THAT(kinds_of(map_of(geojson({"120", no, "1", no}))), testing::IsEmpty());
  }
}

}  // namespace
}  // namespace railfix::track
