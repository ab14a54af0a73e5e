// What plans without coordinates may not be blamed for, and what they are told.
#include "core/random.hpp"
#include "import_fixture.hpp"
#include "small_map.hpp"
#include "track/import/build.hpp"
#include "track/import/finish.hpp"
#include "track/import/xml/railml2_coordinates.hpp"

namespace railfix::track {
namespace {

using testing::Contains;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

class PlanProblems : public ImportTest {};

/// A siding leaves a line of 1000 m at 300 m and comes back at 700 m.
std::string siding(const std::string& length_m, const std::string& elements = "") {
  return R"(<railml version="2.4"><infrastructure><tracks><track id="t1" name="main"><trackTopology>
<trackBegin id="b1" pos="0"/><trackEnd id="e1" pos="1000"/><connections>
<switch id="w1" pos="300"><connection id="c1" ref="c3" orientation="outgoing" course="left"/></switch>
<switch id="w2" pos="700"><connection id="c2" ref="c4" orientation="incoming" course="right"/></switch></connections></trackTopology>
<trackElements>)" +
         elements + R"(</trackElements></track><track id="t2" name="siding"><trackTopology>
<trackBegin id="b2" pos="0"><connection id="c3" ref="c1"/></trackBegin>
<trackEnd id="e2" pos=")" +
         length_m +
         R"("><connection id="c4" ref="c2"/></trackEnd></trackTopology></track></tracks></infrastructure></railml>)";
}

TEST_F(PlanProblems, ADrawingNeedNotClose) {
  const auto file = in_folder("drawn.map");
  const Map map = core::value_or_throw(build_map({write("a.railml", siding("400"))}, {})).map;
  EXPECT_THAT(map.problems, Contains(HasSubstr("laid out as a drawing")));
  EXPECT_THAT(check_topology(map), IsEmpty());
  ASSERT_TRUE(map.save(file).ok());
  EXPECT_THAT(check_topology(core::value_or_throw(Map::load(file))), IsEmpty()) << "it is still known as one";
}

TEST_F(PlanProblems, LengthsThatCannotAgreeAreTold) {
  const Map map = core::value_or_throw(build_map({write("a.railml", siding("900"))}, {})).map;
  EXPECT_THAT(map.problems, Contains(HasSubstr("do the lengths of the tracks there agree?")));
}

TEST_F(PlanProblems, ADrawingDoesNotHideAGapOfTheOthers) {
  Map map = small_map();
  map.edges[2].is_drawn = true;
  map.nodes[1].northing_m += 20;  // where the drawing put it
  EXPECT_THAT(check_topology(map), IsEmpty());
  map.edges[1].alignment = Alignment::chained({2681000, 1250003, core::kPi / 2}, {{800, 0, 0}});
  EXPECT_THAT(check_topology(map), Contains(HasSubstr("edge 2 (on) ends 3.00 m from its node 2")));
}

TEST_F(PlanProblems, ValuesThatNoTrackHasAreTold) {
  const auto problems = [&](const std::string& radius, const std::string& slope) {
    const std::string elements = R"(<radiusChanges><radiusChange id="r" pos="750" radius="500" superelevation=")" +
                                 radius +
                                 R"("/></radiusChanges><gradientChanges><gradientChange id="g" pos="0" slope=")" +
                                 slope + R"("/></gradientChanges>)";
    return core::value_or_throw(build_map({write("a.railml", siding("400", elements))}, {})).map.problems;
  };
  EXPECT_THAT(problems("150", "30"), Not(Contains(HasSubstr("(t1 main"))));
  EXPECT_THAT(problems("90000", "5"), Contains(HasSubstr("has superelevation 90000 mm, which no track has")));
  EXPECT_THAT(problems("0", "1e30"), Contains(testing::EndsWith("climbs 3e+29 m over 300.00 m")));
}

/// An ERJU track of 60 m along these azimuths, a straight every 10 m, with one more for a metre at 29 m.
std::string erju(const std::string& azimuth_at_29, const std::string& azimuth_at_0 = "90") {
  std::string lines;
  for (int at = 0; at < 60; at += 10)
    lines += "<horizontalSegmentLine trackGeometryPos=\"" + std::to_string(1000 * at) + "\" azimuth=\"" +
             (at == 0 ? azimuth_at_0 : "90") + "\"/>";
  return R"(<infrastructure xmlns="https://erju.org/infra"><trackEdges><trackEdge id="T1" trackEdgeLength="60000"/></trackEdges>
<trackEdgeGeometries><trackEdgeGeometry id="T1">)" +
         lines + "<horizontalSegmentLine trackGeometryPos=\"29000\" azimuth=\"" + azimuth_at_29 +
         "\"/></trackEdgeGeometry></trackEdgeGeometries></infrastructure>";
}

TEST_F(PlanProblems, AFirstAzimuthThatIsReversedIsTheOneLeftOut) {
  const Map map = core::value_or_throw(build_map({write("first.xml", erju("90", "270"))}, {})).map;
  EXPECT_THAT(map.problems, Contains(HasSubstr("at 1 of its azimuths, the first at 0.00 m; left out")));
  const auto& track = map.edges[0].alignment;
  EXPECT_NEAR(track.at(60).pose.heading_rad, track.at(0).pose.heading_rad, 1e-9);
}

TEST_F(PlanProblems, AzimuthsThatTurnBackAreLeftOut) {
  const auto file = in_folder("erju.map");
  const Map map = core::value_or_throw(build_map({write("back.xml", erju("270"))}, {})).map;
  EXPECT_THAT(map.problems, Contains(HasSubstr("track edge \"T1\" turns at once by up to 180.0 degrees at 1 of its "
                                               "azimuths, the first at 29.00 m; left out")));
  EXPECT_NEAR(map.edges[0].alignment.at(60).pose.easting_m, 60, 1e-6);
  EXPECT_TRUE(map.save(file).ok());
  EXPECT_THAT(core::value_or_throw(build_map({write("on.xml", erju("90.1"))}, {})).map.problems,
              Not(Contains(HasSubstr("azimuths"))));
}

TEST_F(PlanProblems, ScheibenbergIsBuiltWithoutItsCoordinates) {
  const std::filesystem::path infra = shared_data("network/scheibenberg/infra_v1.0.xml");
  if (!std::filesystem::exists(infra)) GTEST_SKIP() << "no shared data";
  const Map map = core::value_or_throw(build_map({infra}, {})).map;
  EXPECT_TRUE(map.save(in_folder("scheibenberg.map")).ok());
  EXPECT_THAT(map.problems,
              Contains(HasSubstr("track edge \"T11 _ W1 ]-[ W11\" turns at once by up to 180.0 degrees")));
}

/// How far the place at `at_m` is put from its own, at most, where the balises of every group stand 3 m apart and
/// coordinates are rounded to 10 cm.
double most_beside_m(const Alignment& track, const std::vector<double>& groups_m, double at_m) {
  core::Random random(7);
  double most_m = 0;
  for (int i = 0; i < 100; ++i) {
    std::vector<Railml2Coordinates::Point> points;
    for (const double group_m : groups_m) {
      for (const double offset_m : {group_m, group_m + 3}) {
        const PlanPose pose = track.at(offset_m).pose;
        const Eigen::Vector2d rounding(random.uniform(-0.05, 0.05), random.uniform(-0.05, 0.05));
        points.push_back({offset_m, Eigen::Vector2d(pose.easting_m, pose.northing_m) + rounding});
      }
    }
    std::string why;
    const auto shape = shape_between(points, 0, at_m, why);
    EXPECT_EQ(why, "");
    if (shape.empty()) return 1e9;
    const PlanPose there = track.at(at_m).pose;
    most_m = std::max(most_m, (shape.back() - Eigen::Vector2d(there.easting_m, there.northing_m)).norm());
  }
  return most_m;
}

// Between points near to each other and far from the others, their rounding would count by the hundred.
TEST(PlanProblem, ASwitchBetweenBaliseGroupsStandsWhereItsTrackLeads) {
  const Alignment straight = Alignment::chained({0, 0, 1}, {{2100, 0, 0}});
  for (const double at_m : {100.0, 700.0, 1500.0, 1900.0})
    EXPECT_LT(most_beside_m(straight, {0, 200, 1200, 1800, 2000}, at_m), 0.15) << at_m;
  const Alignment curve = Alignment::chained({0, 0, 1}, {{900, 1.0 / 300, 1.0 / 300}});
  for (const double at_m : {225.0, 325.0})
    EXPECT_LT(most_beside_m(curve, {0, 50, 100, 150, 200, 250, 300, 350, 400}, at_m), 0.15) << at_m;
}

TEST_F(PlanProblems, APieceWithoutCoordinatesThatFitSaysWhy) {
  const auto at = [](int easting_m) {
    return "<geoCoord epsgCode=\"32633\" coord=\"" + std::to_string(600000 + easting_m) + " 5300000\"/>";
  };
  const std::string text = R"(<railml version="2.4"><infrastructure><tracks><track id="t1"><trackTopology>
<trackBegin id="b1" pos="0">)" +
                           at(0) + R"(</trackBegin><trackEnd id="e1" pos="1000">)" + at(1000) +
                           R"(</trackEnd><connections><switch id="w1" pos="100">)" + at(110) +
                           R"(<connection id="c1" ref="c2" orientation="outgoing" course="left"/></switch></connections>
</trackTopology></track><track id="t2"><trackTopology><trackBegin id="b2" pos="0"><connection id="c2" ref="c1"/></trackBegin>
<trackEnd id="e2" pos="300"/></trackTopology></track></tracks></infrastructure></railml>)";
  EXPECT_THAT(core::value_or_throw(build_map({write("a.railml", text)}, {})).map.problems,
              Contains("track t1 up to its first switch is 100.00 m long, but 110.00 m by its coordinates; not used"));
}

}  // namespace
}  // namespace railfix::track
