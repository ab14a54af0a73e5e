// Two tracks of OpenStreetMap over one node: slip or crossing?
#include "import_fixture.hpp"
#include "track/import/build.hpp"
#include "track/projection.hpp"

namespace railfix::track {
namespace {

using testing::AllOf;
using testing::Contains;
using testing::Each;
using testing::HasSubstr;
using testing::Not;

class OsmCrossingsTest : public ImportTest {
 protected:
  /// Ways 1 and 2, straight through node 3, 300 m to either side.
  [[nodiscard]] Map tracks_at(double degrees, const std::string& node_tags = "",
                              const std::string& second_way_tags = "") const {
    const Projection utm = core::value_or_throw(Projection::open("EPSG:32633"));
    const double rad = core::rad_from_deg(degrees);
    const auto node = [&](int id, double along_m, double turn_rad, const std::string& tags) {
      const GeoPoint place = *utm.to_geo(500000 + along_m * std::cos(turn_rad), 5340000 + along_m * std::sin(turn_rad));
      char text[300];
      std::snprintf(text, sizeof text, R"({"type":"node","id":%d,"lat":%.9f,"lon":%.9f,"tags":{%s}},)", id,
                    place.lat_deg, place.lon_deg, tags.c_str());
      return std::string(text);
    };
    const std::string nodes = node(1, -300, 0, "") + node(2, 300, 0, "") + node(3, 0, 0, node_tags) +
                              node(4, -300, rad, "") + node(5, 300, rad, "");
    const auto file = write(
        "a.json", R"({"elements":[)" + nodes + R"({"type":"way","id":1,"nodes":[1,3,2],"tags":{"railway":"rail"}},)" +
                      R"({"type":"way","id":2,"nodes":[4,3,5],"tags":{"railway":"rail")" + second_way_tags + "}}]}");
    return core::value_or_throw(build_map({file}, {.crs = "EPSG:32633"})).map;
  }
  static NodeKind kind_in(const Map& map) {
    return std::ranges::find_if(
               map.nodes,
               [](const Node& node) { return std::hypot(node.easting_m - 500000, node.northing_m - 5340000) < 0.1; })
        ->kind;
  }
};

TEST_F(OsmCrossingsTest, AFlatOneThatSaysNothingIsADoubleSlipAndTold) {
  const Map map = tracks_at(8);
  EXPECT_EQ(kind_in(map), NodeKind::railway_switch);
  EXPECT_EQ(map.connections.size(), 4U);
  EXPECT_THAT(map.problems,
              Contains(AllOf(HasSubstr("slip or crossing? Of 1 nodes"), HasSubstr("node 3 of way/1 at"))));
}

TEST_F(OsmCrossingsTest, OneThatNoSlipIsAsSteepAsIsACrossing) {
  EXPECT_EQ(kind_in(tracks_at(13)), NodeKind::railway_switch);
  for (const double degrees : {17.0, 30.0, 55.0}) {
    const Map map = tracks_at(degrees);
    EXPECT_EQ(kind_in(map), NodeKind::crossing) << degrees;
    EXPECT_EQ(map.connections.size(), 2U) << degrees;
    EXPECT_THAT(map.problems, Each(AllOf(Not(HasSubstr("kink")), Not(HasSubstr("slip"))))) << degrees;
  }
}

TEST_F(OsmCrossingsTest, WhatTheSourceSaysHolds) {
  const Map slip = tracks_at(20, R"("railway":"switch")");
  EXPECT_EQ(kind_in(slip), NodeKind::railway_switch);
  EXPECT_EQ(slip.connections.size(), 4U);
  const Map crossing = tracks_at(8, R"("railway":"railway_crossing")");
  EXPECT_EQ(kind_in(crossing), NodeKind::crossing);
  for (const Map& map : {slip, crossing}) EXPECT_THAT(map.problems, Each(Not(HasSubstr("slip or crossing?"))));
}

TEST_F(OsmCrossingsTest, NoTrainChangesFromABridgeToTheTrackBelow) {
  const Map map = tracks_at(8, "", R"(,"bridge":"yes","layer":"1")");
  EXPECT_EQ(kind_in(map), NodeKind::crossing);
  EXPECT_EQ(map.connections.size(), 2U);
  EXPECT_THAT(map.problems, Contains(HasSubstr("way/1 (layer 0) and way/2 (layer 1) share node 3 of way/1 at")));
}

TEST_F(OsmCrossingsTest, ASingleSlipHasTwoWaysTooManyAndIsTold) {
  const Map map = tracks_at(8, R"("railway":"switch","railway:switch":"single_slip")");
  EXPECT_EQ(map.connections.size(), 4U);
  EXPECT_THAT(map.problems, Contains(AllOf(HasSubstr("1 single slips have both"), HasSubstr("node 3 of way/1 at"))));
  EXPECT_THAT(tracks_at(8, R"("railway":"switch","railway:switch":"double_slip")").problems,
              Each(Not(HasSubstr("single slip"))));
}

// Two more of Ventimiglia-Albenga are tagged; all are as flat as slips are.
TEST_F(OsmCrossingsTest, ThoseOfRealStationsStaySlips) {
  for (const auto& [name, slips] :
       {std::pair("network/osm/sankt_poelten.json", 17), std::pair("network/osm/Ventimiglia_Albenga.geojson", 3)}) {
    const std::filesystem::path file = shared_data(name);
    if (!std::filesystem::exists(file)) GTEST_SKIP() << "skipped: no " << file;
    const Map map = core::value_or_throw(build_map({file}, {})).map;
    EXPECT_EQ(std::ranges::count(map.nodes, NodeKind::crossing, &Node::kind), 0) << name;
    EXPECT_THAT(map.problems, Contains(HasSubstr("slip or crossing? Of " + std::to_string(slips) + " nodes"))) << name;
  }
}

}  // namespace
}  // namespace railfix::track
