// The ERJU digital map: where things lie on its track edges, and what of it is not read.
#include "import_fixture.hpp"
#include "track/import/build.hpp"

namespace railfix::track {
namespace {

using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

class ErjuTest : public ImportTest {
 protected:
  /// T1, T2 and T3, 300 m each, in a row.
  [[nodiscard]] Map map_of(const std::string& elements) const {
    const std::string text =
        R"(<infrastructure xmlns="https://erju.org/infra"><trackEdges><trackEdge id="T1" trackEdgeLength="300000"/>
<trackEdge id="T2" trackEdgeLength="300000"/><trackEdge id="T3" trackEdgeLength="300000"/></trackEdges><trackEdgeLinks>
<trackEdgeLink id="l12" trackEdgeA="T1" trackEdgeB="T2" startOfA="false" startOfB="true"/>
<trackEdgeLink id="l23" trackEdgeA="T2" trackEdgeB="T3" startOfA="false" startOfB="true"/></trackEdgeLinks>)" +
        elements + "</infrastructure>";
    return core::value_or_throw(build_map({write("infra.xml", text)}, {})).map;
  }

  static std::string section(const std::string& edge, const std::string& from_start, const std::string& from_end) {
    return "<trackEdgeSection trackEdge=\"" + edge + "\" skipFromStart=\"" + from_start + "\" skipFromEnd=\"" +
           from_end + "\"/>";
  }
  static std::string tunnel(const std::string& sections) {
    return "<tunnels><tunnel tunnelIdentification=\"TU\"><tunnelTubes><tunnelTube crossSection=\"40\"><trackArea>"
           "<trackEdgeSections>" +
           sections + "</trackEdgeSections></trackArea></tunnelTube></tunnelTubes></tunnel></tunnels>";
  }
  static std::string geometry(const std::string& edge, const std::string& items) {
    return "<trackEdgeGeometry id=\"" + edge + "\"><horizontalAlignment>" + items +
           "</horizontalAlignment></trackEdgeGeometry>";
  }
  static std::string line(int at_m, double azimuth_deg) {
    return "<horizontalSegmentLine trackGeometryPos=\"" + std::to_string(1000 * at_m) + "\" azimuth=\"" +
           std::to_string(azimuth_deg) + "\"/>";
  }
  static std::string arc(int at_m, double azimuth_deg, int radius_m) {
    return "<horizontalSegmentArc trackGeometryPos=\"" + std::to_string(1000 * at_m) + "\" azimuth=\"" +
           std::to_string(azimuth_deg) + "\" radius=\"" + std::to_string(1000 * radius_m) + "\"/>";
  }
  static std::vector<std::string> portals(const Map& map) {
    return marks_of(map, {LandmarkKind::portal_in, LandmarkKind::portal_out});
  }
};

TEST_F(ErjuTest, ATunnelHasItsPortalsWhereNothingOfItGoesOn) {
  EXPECT_THAT(portals(map_of(tunnel(section("T2", "0", "0")))),
              ElementsAre("portal_in TU at 0.0 on 2", "portal_out TU at 300.0 on 2"));
  EXPECT_THAT(
      portals(map_of(tunnel(section("T1", "200000", "0") + section("T2", "0", "0") + section("T3", "0", "250000")))),
      ElementsAre("portal_in TU at 200.0 on 1", "portal_out TU at 50.0 on 3"));
  EXPECT_THAT(portals(map_of(tunnel(section("T1", "200000", "0") + section("T3", "0", "250000")))),
              ElementsAre("portal_in TU at 200.0 on 1", "portal_out TU at 300.0 on 1", "portal_in TU at 0.0 on 3",
                          "portal_out TU at 50.0 on 3"));
}

TEST_F(ErjuTest, WhatIsNotOnItsTrackEdgeIsLeftOutAndTold) {
  const std::string told = " is not on its track edge \"T3\"; it is left out there";
  for (const auto& [from_start, from_end] :
       {std::pair("900000", "0"), {"0", "900000"}, {"200000", "200000"}, {"-1", "0"}}) {
    SCOPED_TRACE(std::string(from_start) + " " + from_end);
    const std::string there = section("T3", from_start, from_end);
    const Map map = map_of(tunnel(there) + "<bridges><bridge id=\"BR\"><trackArea>" + there +
                           "</trackArea></bridge></bridges><levelCrossings><levelCrossing id=\"LX\">"
                           "<spotLocation trackEdge=\"T3\" pos=\"300100\"/></levelCrossing></levelCrossings>");
    EXPECT_THAT(map.landmarks, IsEmpty());
    EXPECT_THAT(map.problems, testing::IsSupersetOf({"<tunnel> \"TU\"" + told, "<bridge> \"BR\"" + told,
                                                     "<levelCrossing> \"LX\"" + told}));
  }
}

TEST_F(ErjuTest, WhatIsNotReadIsTold) {
  const auto alignment = [](const std::string& edge, const std::string& items) {
    return "<trackEdgeGeometry id=\"" + edge + "\"><verticalAlignment>" + items +
           "</verticalAlignment></trackEdgeGeometry>";
  };
  const std::string line =
      "<verticalAlignmentItem><verticalSegmentLine trackGeometryPos=\"0\" slope=\"12.5\"/></verticalAlignmentItem>";
  const std::string curves =
      "<sampledTrackEdgeGeometry id=\"T2\"><slopes><slope pos=\"0\" samplePointSlope=\"10\"/></slopes><curves>"
      "<curve pos=\"0\" sampleCurveRadius=\"600000\"/></curves></sampledTrackEdgeGeometry>";
  EXPECT_THAT(
      map_of(alignment("T1", line) + alignment("T2", "") + alignment("T3", line) + curves).problems,
      testing::IsSupersetOf(
          {"track edge \"T1\", as 1 more, has gradients in its vertical alignment, whose units no schema at hand "
           "gives; they are left out, only sampled slopes are read",
           "track edge \"T2\" has sampled curve radii, whose unit and sign no schema at hand gives; they are left "
           "out, curves come from coordinates or azimuths"}));
  EXPECT_THAT(map_of(alignment("T1", "")).problems, testing::Not(Contains(HasSubstr("no schema at hand"))));
}

TEST_F(ErjuTest, ABridgeOverAJointIsOne) {
  const auto bridge = [](const std::string& sections) {
    return "<bridges><bridge id=\"BR\"><trackArea><trackEdgeSections>" + sections +
           "</trackEdgeSections></trackArea></bridge></bridges>";
  };
  const auto bridges = [&](const std::string& sections) {
    return marks_of(map_of(bridge(sections)), {LandmarkKind::underbridge});
  };
  EXPECT_THAT(bridges(section("T1", "280000", "0") + section("T2", "0", "260000")),
              ElementsAre("underbridge BR at 10.0 on 2"));
  EXPECT_THAT(bridges(section("T2", "0", "260000") + section("T1", "280000", "0")),
              ElementsAre("underbridge BR at 10.0 on 2"));
  EXPECT_THAT(bridges(section("T2", "0", "260000") + section("T2", "10000", "260000") + section("T1", "280000", "0")),
              ElementsAre("underbridge BR at 10.0 on 2"));
  EXPECT_THAT(bridges(section("T1", "280000", "0") + section("T2", "50000", "240000")),
              ElementsAre("underbridge BR at 290.0 on 1", "underbridge BR at 55.0 on 2"));
}

TEST_F(ErjuTest, AnUnderpassIsOnTheMapAndTold) {
  const Map map =
      map_of("<underpasses><underpass id=\"UP\"><trackArea><trackEdgeSections>" + section("T2", "100000", "190000") +
             "</trackEdgeSections></trackArea></underpass></underpasses>");
  EXPECT_THAT(marks_of(map, {LandmarkKind::underbridge, LandmarkKind::bridge}),
              ElementsAre("underbridge UP at 105.0 on 2"));
  EXPECT_THAT(map.problems,
              Contains("1 <underpass>: whether the track leads over or under them the schema does not say; they are "
                       "taken as under the track, where no camera looks for them"));
}

TEST_F(ErjuTest, AnArcThatNoAzimuthEndsHasItsRadius) {
  const Map map =
      map_of(geometry("T1", line(0, 90) + arc(100, 90, 400)) + geometry("T2", line(0, 90) + arc(100, 90, 0)));
  EXPECT_EQ(map.edges[0].alignment.curvature_at(50), 0);
  EXPECT_NEAR(map.edges[0].alignment.curvature_at(200), 1.0 / 400, 1e-9) << "left positive";
  EXPECT_EQ(map.edges[1].alignment.curvature_at(200), 0);
  EXPECT_THAT(map.problems, Contains("track edge \"T2\" has a curve at 100.00 m that no azimuth ends, and no arc's "
                                     "radius; it is taken as a straight"));
}

/// T1 with points every 10 m, `off_m` to the left of its plan in the middle.
class ErjuPlan : public ErjuTest {
 protected:
  [[nodiscard]] Map with_points(const std::string& items, double off_m) const {
    const std::string infra =
        R"(<infrastructure xmlns="https://erju.org/infra"><trackEdges><trackEdge id="T1" trackEdgeLength="300000"/></trackEdges>)" +
        geometry("T1", items) + "</infrastructure>";
    const Alignment plan =
        Alignment::chained({4500000, 5600000, 0.5 * M_PI}, {{100, 0, 0}, {100, -0.005, -0.005}, {100, 0, 0}});
    std::string points;
    for (int at_m = 0; at_m <= 300; at_m += 10) {
      const PlanPose pose = plan.at(at_m).pose;
      const double left_m = at_m == 150 ? off_m : 0;
      points += "<coordinate pos=\"" + std::to_string(1000 * at_m) + "\" x=\"" +
                std::to_string(pose.easting_m - left_m * std::cos(pose.heading_rad)) + "\" y=\"" +
                std::to_string(pose.northing_m + left_m * std::sin(pose.heading_rad)) + "\"/>";
    }
    const std::string map =
        R"(<mapMgmt xmlns="https://erju.org/map"><mapAreas><mapArea epsg="31468"><trackEdgeProjections>)"
        R"(<trackEdgeProjection id="T1"><coordinates>)" +
        points + "</coordinates></trackEdgeProjection></trackEdgeProjections></mapArea></mapAreas></mapMgmt>";
    return core::value_or_throw(build_map({write("infra.xml", infra), write("map.xml", map)}, {})).map;
  }
};

TEST_F(ErjuPlan, StraightsAndArcsThatThePointsBearOutAreTheTrack) {
  // The arc turns by half a radian; azimuths are of true north, the points a degree aside.
  const std::string whole = line(0, 91) + arc(100, 91, -200) + line(200, 91 + 0.5 * 180 / M_PI);
  const Map map = with_points(whole, 0.1);
  const std::vector<Element>& elements = map.edges[0].alignment.elements();
  ASSERT_EQ(elements.size(), 3U);
  EXPECT_EQ(elements[0].curvature_start_per_m, 0);
  EXPECT_NEAR(elements[1].curvature_start_per_m, -1.0 / 200, 1e-9);  // the points are rounded
  EXPECT_NEAR(elements[1].length_m, 100, 1e-6);
  EXPECT_NEAR(map.edges[0].alignment.at(150).pose.heading_rad, 0.5 * M_PI + 0.25, 1e-4);
  EXPECT_THAT(map.problems, testing::Not(Contains(HasSubstr("it follows the coordinates"))));

  EXPECT_THAT(with_points(whole, 2).problems,
              Contains(testing::MatchesRegex("track T1 has coordinates up to 2.00 m off the straights and arcs that "
                                             "are said of it; it follows the coordinates")));
  // Straights that turn where they meet only follow the drawing.
  EXPECT_NE(with_points(line(0, 90) + line(100, 104) + line(200, 119), 0).edges[0].alignment.elements().size(), 1U);
}

/// A left curve from 100 m to 200 m of T1, and a right one on T2.
class ErjuCant : public ErjuTest {
 protected:
  [[nodiscard]] static std::string samples(const std::string& edge, int cant_mm) {
    return "<sampledTrackEdgeGeometry id=\"" + edge + "\"><cants><cant pos=\"0\" samplePointCant=\"0\"/>" +
           "<cant pos=\"110000\" samplePointCant=\"" + std::to_string(cant_mm) +
           "\"/><cant pos=\"190000\" samplePointCant=\"0\"/></cants></sampledTrackEdgeGeometry>";
  }
  [[nodiscard]] static std::string curve(const std::string& edge, double to_deg) {
    return geometry(edge, line(0, 90) + arc(100, 90, 0) + line(200, to_deg));
  }
  [[nodiscard]] Map with(int left_mm, int right_mm) const {
    return map_of(curve("T1", 80) + curve("T2", 100) + samples("T1", left_mm) + samples("T2", right_mm));
  }
  static double cant_m(const Map& map, uint32_t edge) { return map.edge(edge)->alignment.at(150).cant_m; }
};

TEST_F(ErjuCant, SamplesHoldAndTheOuterRailOfTheCurvesIsTheHigherOne) {
  for (const auto& [left_mm, right_mm] : {std::pair(60, -80), {-60, 80}, {60, 80}}) {
    SCOPED_TRACE(std::to_string(left_mm) + " " + std::to_string(right_mm));
    const Map map = with(left_mm, right_mm);
    EXPECT_NEAR(cant_m(map, 1), 0.06, 1e-12);
    EXPECT_NEAR(cant_m(map, 2), -0.08, 1e-12);
    EXPECT_EQ(map.edges[0].alignment.at(100).cant_m, 0);
    EXPECT_EQ(map.edges[0].alignment.at(195).cant_m, 0);
    EXPECT_THAT(map.problems,
                Contains("2 track edges have their cant from samples, taken as millimetres that hold up to "
                         "the next one, as sampled slopes do; the schema does not say it"));
    EXPECT_THAT(map.problems, testing::Not(Contains(HasSubstr("rail"))));
  }
}

TEST_F(ErjuCant, WhatIsNotSureOfItIsTold) {
  EXPECT_THAT(map_of(samples("T1", 60)).problems,
              Contains("no azimuths show the curves that cant is on, and the schema does not say which rail is higher "
                       "where it is positive: it is taken as the right one, as in a left curve"));
  EXPECT_THAT(with(-60, -80).problems,
              Contains("cant makes the inner rail of a curve the higher one at 1 of 2 places in curves, whatever its "
                       "sign means: look at the source"));
  const Map map =
      map_of(curve("T1", 80) + curve("T2", 100) + samples("T1", 60) + samples("T2", 80) + samples("T3", 40));
  EXPECT_THAT(map.problems,
              Contains("track edge \"T3\" has cant and no curve that says which rail is higher; left out"));
  EXPECT_EQ(cant_m(map, 3), 0);
  EXPECT_THAT(with(301, 0).problems,
              Contains("track edge \"T1\" has samplePointCant 301 mm at 110.00 m, which no track has; left out"));
}

// A reference that is not where its track edge is would put every train to the edge's end.
TEST_F(ErjuTest, BalisesOffTheirTrackEdgeAreLeftOutAndTold) {
  const auto group = [](int number, const std::vector<int>& at_m) {
    std::string text = "<baliseGroup id=\"g" + std::to_string(number) + "\" nid_c=\"1\" nid_bg=\"" +
                       std::to_string(number) + "\"><balises>";
    for (const int at : at_m)
      text += "<balise id=\"x" + std::to_string(at) + "\"><spotLocation trackEdge=\"T1\" pos=\"" +
              std::to_string(1000 * at) + "\"/></balise>";
    return text + "</balises></baliseGroup>";
  };
  const Map map = map_of("<baliseGroups>" + group(1, {-50}) + group(2, {400}) + group(3, {200, 301}) +
                         group(4, {-1, 2}) + "</baliseGroups>");
  ASSERT_EQ(map.balise_groups.size(), 1U);
  EXPECT_EQ(map.balise_groups[0].nid_bg, 3U);
  EXPECT_EQ(map.balise_groups[0].offset_m, 200);
  EXPECT_EQ(map.balise_groups[0].balises.size(), 1U);
  EXPECT_EQ(map.balise_groups[0].q_locacc_m, 12) << "the file says none";
  EXPECT_THAT(marks_of(map, {LandmarkKind::balise}), ElementsAre("balise x2 at 2.0 on 1", "balise x200 at 200.0 on 1"));
  for (const char* balise : {"x-50", "x400", "x301", "x-1"})
    EXPECT_THAT(map.problems,
                Contains("balise \"" + std::string(balise) + "\" is not on its track edge; it is left out"));
  for (const char* number : {"g1", "g2"})
    EXPECT_THAT(map.problems, Contains("balise group \"" + std::string(number) +
                                       "\" has no balises on a track edge; it is left out"));
  EXPECT_THAT(map.problems, Contains("balise group \"g4\" lacks its first balise, which its place counts from; its "
                                     "other balises are kept as landmarks"));
}

}  // namespace
}  // namespace railfix::track
