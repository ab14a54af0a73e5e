// Whole plans of the ERJU digital map.
#include <algorithm>

#include "import_fixture.hpp"
#include "plans.hpp"
#include "track/import/build.hpp"

namespace railfix::track {
namespace {

using testing::Contains;
using testing::HasSubstr;

class WholeErjuPlan : public ImportTest {};

TEST_F(WholeErjuPlan, ValuesThatAreNoneAreLeftOutAndTold) {
  std::string text = kInfra;
  const auto instead = [&](const std::string& old, const std::string& now) {
    text.replace(text.find(old), old.size(), now);
  };
  instead(
      "</cantPoints>",
      R"(<cantPoint trackGeometryPos="150000" appliedCant="301"/><cantPoint trackGeometryPos="200000" appliedCant="-50000"/></cantPoints>)");
  instead(R"(pos="200000" speed="40")", R"(pos="200000" speed="601")");
  instead(R"(pos="300000" speed="50")", R"(pos="300000" speed="-1")");
  const Map map = core::value_or_throw(build_map({write("infra.xml", text)}, {})).map;
  EXPECT_THAT(
      map.problems,
      testing::IsSupersetOf(
          {"track edge \"T1\" has appliedCant 301 mm at 150.00 m and 1 more like it, which no track has; left "
           "out",
           "track edge \"T1\" has sameDirProfile speed 601 km/h at 200.00 m, which no train runs; no limit begins "
           "there",
           "track edge \"T1\" has oppositeDirProfile speed -1 km/h at 300.00 m, which no train runs; no limit "
           "begins there"}));
  EXPECT_NEAR(map.edges[0].alignment.at(300).cant_m, 0.05, 1e-12) << "as the last point that is one says";
  ASSERT_EQ(map.edges[0].speed_limits.size(), 2U);
  EXPECT_NEAR(map.edges[0].speed_limits[0].to_m, 200, 1e-9);
  EXPECT_NEAR(map.edges[0].speed_limits[1].speed_mps, 70 / 3.6, 1e-9);
}

TEST_F(WholeErjuPlan, WithoutCoordinatesIsADrawing) {
  const Map map = core::value_or_throw(build_map({write("infra.xml", kInfra)}, {})).map;
  ASSERT_EQ(map.edges.size(), 2U);
  EXPECT_NEAR(length_of(map), 800, 1e-6);
  EXPECT_EQ(map.connections.size(), 1U);
  ASSERT_EQ(map.balise_groups.size(), 1U);
  EXPECT_FALSE(map.balise_groups[0].nominal_is_forward);
  EXPECT_NEAR(map.balise_groups[0].offset_m, 13, 1e-9);
  EXPECT_NEAR(map.edges[0].alignment.at(100).cant_m, 0.05, 1e-12);
  EXPECT_NEAR(map.edges[1].alignment.at(0).elevation_m, 5, 1e-9);
  EXPECT_EQ(level_crossing_of(map).first, "LX");
  EXPECT_NEAR(level_crossing_of(map).second, 105, 1e-9);
  using Kind = LandmarkKind;
  EXPECT_THAT(marks_of(map, {Kind::portal_in, Kind::portal_out, Kind::bridge, Kind::underbridge}),
              testing::ElementsAre("portal_in TU at 120.0 on 2", "portal_out TU at 220.0 on 2",
                                   "underbridge BR at 250.0 on 2"));
  EXPECT_THAT(marks_of(map, {Kind::platform}),
              testing::ElementsAre("platform P1 at 420.0 on 1", "platform P1 at 40.0 on 2", "platform P2 at 50.0 on 2",
                                   "platform P2 at 100.0 on 2"));
  EXPECT_THAT(map.problems, Contains("platform edge \"P3\" is not on its track edges; it is left out"));
  EXPECT_THAT(marks_of(map, {Kind::mast}), testing::ElementsAre("mast 12 at 92.1 on 1"));
  EXPECT_THAT(map.problems, Contains("ETCS marker board \"13\" is not on its track edge; it is left out"));
  EXPECT_NEAR(limit_kmh(map, 1, 100, Direction::forward), 60, 1e-9);
  EXPECT_NEAR(limit_kmh(map, 1, 250, Direction::forward), 40, 1e-9);
  EXPECT_NEAR(limit_kmh(map, 1, 100, Direction::reverse), 50, 1e-9);
  EXPECT_NEAR(limit_kmh(map, 1, 400, Direction::reverse), 70, 1e-9);
  EXPECT_EQ(limit_kmh(map, 2, 100, Direction::forward), 0);
}

TEST_F(WholeErjuPlan, ScheibenbergIsReadWhole) {
  const std::filesystem::path infra = shared_data("network/scheibenberg/infra_v1.0.xml");
  const std::filesystem::path places = shared_data("network/scheibenberg/map_v1.0.xml");
  if (!std::filesystem::exists(infra)) GTEST_SKIP() << "skipped: no " << infra;
  const BuiltMap built = core::value_or_throw(build_map({infra, places}, {}));
  const Map& map = built.map;
  EXPECT_EQ(map.crs, "EPSG:31468");  // the file names the zone by a number that PROJ has not
  EXPECT_EQ(map.edges.size(), 11U);
  EXPECT_EQ(map.balise_groups.size(), 115U);
  EXPECT_EQ(std::ranges::count(map.landmarks, LandmarkKind::balise, &Landmark::kind), 163);
  EXPECT_EQ(std::ranges::count(map.landmarks, LandmarkKind::mast, &Landmark::kind), 56) << "marker boards";
  EXPECT_EQ(std::count_if(map.nodes.begin(), map.nodes.end(),
                          [](const Node& node) { return node.kind == NodeKind::railway_switch; }),
            6);
  // As the files count, but for one edge whose coordinates are 20.5 m shorter than its length.
  EXPECT_NEAR(length_of(map), 26258.83 - 20.5, 1);
  EXPECT_THAT(map.problems, Contains(HasSubstr("T11")));
  // The file says this one as a straight, an arc and a straight, and its points lie on them.
  const auto t6 = std::ranges::find_if(map.edges, [](const Edge& edge) { return edge.name.starts_with("T6 "); });
  ASSERT_EQ(t6->alignment.elements().size(), 3U);
  EXPECT_NEAR(1 / t6->alignment.elements()[1].curvature_start_per_m, -190.1, 0.01);
  EXPECT_TRUE(
      std::none_of(map.edges.begin(), map.edges.end(), [](const Edge& edge) { return edge.speed_limits.empty(); }));
  EXPECT_LT(built.fit.max_m, 0.5);
  const auto geo = map.to_geo(map.nodes[0].easting_m, map.nodes[0].northing_m);
  ASSERT_TRUE(geo);
  EXPECT_NEAR(geo->lat_deg, 50.54, 0.1);  // Scheibenberg in Saxony
  EXPECT_NEAR(geo->lon_deg, 12.91, 0.15);
}

}  // namespace
}  // namespace railfix::track
