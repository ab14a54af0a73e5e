// GeoJSON as different programs write OpenStreetMap data: all of its tags, the ids of its ways, and points beside them.
#include "import_fixture.hpp"
#include "track/import/build.hpp"

namespace railfix::track {
namespace {

using testing::Contains;
using testing::HasSubstr;
using testing::Not;

class OsmFeatureTags : public ImportTest {
 protected:
  /// A track of three points with these properties, and members of the feature beside them.
  [[nodiscard]] static std::string line(const std::string& properties, const std::string& members = "") {
    return R"({"type":"Feature",)" + members + R"("properties":{)" + properties +
           R"(},"geometry":{"type":"LineString","coordinates":[[15,48],[15.002,48],[15.004,48]]}})";
  }
  [[nodiscard]] static std::string point(const std::string& properties, const std::string& at) {
    return R"({"type":"Feature","properties":{)" + properties + R"(},"geometry":{"type":"Point","coordinates":[)" + at +
           "]}}";
  }
  [[nodiscard]] static std::string collection(const std::string& features) {
    return R"({"type":"FeatureCollection","features":[)" + features + "]}";
  }
  [[nodiscard]] Map map_of(const std::string& features) const {
    return core::value_or_throw(build_map({write("a.geojson", collection(features))}, {})).map;
  }
};

TEST_F(OsmFeatureTags, WhatOgr2ogrHasNoColumnForIsRead) {
  const std::string texts[] = {
      R"("other_tags":"\"bridge\"=>\"yes\",\"bridge:name\"=>\"B \\\"1\\\"\",\"maxspeed\"=>\"80\"")",
      R"("other_tags":"{\"bridge\":\"yes\",\"bridge:name\":\"B \\\"1\\\"\",\"maxspeed\":\"80\"}")",
      R"("all_tags":"\"maxspeed\"=>\"80\",\"bridge\"=>\"yes\",\"bridge:name\"=>\"B \\\"1\\\"\"")"};
  for (const std::string& text : texts) {
    const Map map = map_of(line(R"("osm_id":"77","railway":"rail",)" + text));
    ASSERT_EQ(map.edges.size(), 1U);
    EXPECT_EQ(map.edges[0].name, "way/77");
    EXPECT_NEAR(map.edges[0].speed_limit_mps(50, Direction::forward).value_or(0), 80 / 3.6, 1e-9) << text;
    ASSERT_EQ(map.landmarks.size(), 1U) << text;
    EXPECT_EQ(map.landmarks[0].name, "B \"1\"");
  }
  // NULL is a value, too; cut short, what is whole is read.
  const Map with_null = map_of(line(R"("railway":"rail","other_tags":"\"service\"=>NULL, \"maxspeed\"=>\"80\"")"));
  EXPECT_TRUE(with_null.edges.at(0).speed_limit_mps(50, Direction::forward).has_value());
  const Map map = map_of(line(R"("railway":"rail","other_tags":"\"maxspeed\"=>\"80\",\"bridge\"=>\"ye")"));
  EXPECT_TRUE(map.landmarks.empty());
  EXPECT_TRUE(map.edges.at(0).speed_limit_mps(50, Direction::forward).has_value());
}

TEST_F(OsmFeatureTags, AWayIsCalledAsTheSourceCallsIt) {
  const auto name = [&](const std::string& properties, const std::string& members = "") {
    return map_of(line(R"("railway":"rail")" + properties, members)).edges.at(0).name;
  };
  EXPECT_EQ(name(R"(,"@id":"way/12")"), "way/12");
  EXPECT_EQ(name(R"(,"@id":12,"@type":"way")"), "way/12");
  EXPECT_EQ(name("", R"("id":"way/12",)"), "way/12");
  EXPECT_EQ(name("", R"("id":"w12",)"), "way/12");
  EXPECT_EQ(name(R"(,"osm_id":"12")"), "way/12");
  EXPECT_EQ(name(""), "way/-1");
  EXPECT_EQ(name("", R"("id":"w",)"), "way/-1");
  EXPECT_EQ(name(R"(,"@id":"relation/5")"), "way/-1");
}

TEST_F(OsmFeatureTags, LinesAndPointsMayBeTwoFiles) {
  const auto lines = write("lines.geojson", collection(line(R"("railway":"rail")")));
  const auto points =
      write("points.geojson", collection(point(R"("other_tags":"\"railway\"=>\"level_crossing\"")", "15.002,48")));
  for (const auto& files : {std::vector{lines, points}, std::vector{points, lines}}) {
    const Map map = core::value_or_throw(build_map(files, {})).map;
    ASSERT_EQ(map.landmarks.size(), 1U);
    EXPECT_EQ(map.landmarks[0].kind, LandmarkKind::level_crossing);
  }
}

TEST_F(OsmFeatureTags, PointsBesideTheTrackAndHeightsAreTold) {
  const std::string signal = R"("railway":"signal")";
  const auto beside = HasSubstr("are no points of a track");
  EXPECT_THAT(map_of(line(R"("railway":"rail")") + "," + point(signal, "15.002,48")).problems, Not(Contains(beside)));
  const Map map = map_of(line(R"("railway":"rail")") + "," + point(signal, "15.002,48.000002"));
  EXPECT_THAT(map.problems, Contains(HasSubstr("the first one at latitude 48.000002, longitude 15.002000")));
  EXPECT_TRUE(map.landmarks.empty());
  const std::string high =
      R"({"properties":{"railway":"rail"},"geometry":{"type":"LineString","coordinates":[[15,48,200],[15.002,48,201]]}})";
  EXPECT_THAT(map_of(high).problems, Contains(HasSubstr("1 line with heights")));
}

}  // namespace
}  // namespace railfix::track
