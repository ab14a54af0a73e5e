// Trains run over a node where the source says so, whatever the directions of the tracks suggest.
#include <algorithm>
#include <set>

#include "import_fixture.hpp"
#include "railml_text.hpp"
#include "track/import/build.hpp"
#include "track/import/xml/rail_net.hpp"

namespace railfix::track {
namespace {

/// Two straight tracks of 2 x 500 m that meet at their middle under 10 degrees: 1 and 3, 2 and 4.
RailNet crossing_tracks() {
  RailNet net;
  for (const double heading_deg : {0.0, 10.0}) {
    const Eigen::Vector2d along(std::cos(heading_deg * core::kPi / 180), std::sin(heading_deg * core::kPi / 180));
    for (const double from_m : {-500.0, 0.0}) {
      NetTrack track;
      track.track.name = std::to_string(net.tracks.size() + 1);
      track.length_m = 500;
      for (int i = 0; i <= 10; ++i) track.shape.push_back((from_m + 50 * i) * along);
      net.tracks.push_back(track);
    }
  }
  std::swap(net.tracks[1], net.tracks[2]);
  for (const auto& [a, b] : {std::pair(0U, 2U), std::pair(1U, 3U)}) net.links.push_back({{a, true}, {b, false}});
  return net;
}
NetLink other_way(bool passable) {
  return {.a = {0, true}, .b = {3, false}, .passable = passable, .diverging = true};
}

Map map_of(RailNet net) {
  Map map;
  append(draft_of(net), map);
  return map;
}
std::set<std::pair<uint32_t, uint32_t>> ways_of(const Map& map, bool diverging) {
  std::set<std::pair<uint32_t, uint32_t>> ways;
  for (const auto& way : map.connections) {
    if (way.diverging == diverging) ways.insert(std::minmax(way.edge_a, way.edge_b));
  }
  return ways;
}
std::vector<NodeKind> kinds_of(const Map& map) {
  std::vector<NodeKind> kinds;
  for (const auto& node : map.nodes) {
    if (node.kind != NodeKind::end) kinds.push_back(node.kind);
  }
  return kinds;
}

using Ways = std::set<std::pair<uint32_t, uint32_t>>;

TEST(RailNet, NobodyChangesTrackOnACrossing) {
  auto net = crossing_tracks();
  net.links.push_back(other_way(false));
  const Map map = map_of(net);
  EXPECT_EQ(ways_of(map, false), (Ways{{1, 3}, {2, 4}}));
  EXPECT_TRUE(ways_of(map, true).empty());
  EXPECT_THAT(kinds_of(map), testing::ElementsAre(NodeKind::crossing));
}

TEST(RailNet, ASingleSlipHasOneWayMore) {
  auto net = crossing_tracks();
  net.links.push_back(other_way(true));
  const Map map = map_of(net);
  EXPECT_EQ(ways_of(map, false), (Ways{{1, 3}, {2, 4}}));
  EXPECT_EQ(ways_of(map, true), (Ways{{1, 4}}));
  EXPECT_THAT(kinds_of(map), testing::ElementsAre(NodeKind::railway_switch));
}

// The main line turns at the switch, and the straight leg is the branch.
TEST(RailNet, WhatDivergesIsWhatTheSourceSays) {
  auto net = crossing_tracks();
  net.links = {{.a = {0, true}, .b = {2, false}, .diverging = true}, {.a = {0, true}, .b = {3, false}}};
  const Map map = map_of(net);
  EXPECT_EQ(ways_of(map, false), (Ways{{1, 4}}));
  EXPECT_EQ(ways_of(map, true), (Ways{{1, 3}}));
}

// Beside one of 1000 m that climbs 5 per mille.
TEST(RailNet, ManyTracksWithoutGradientsClimbEvenly) {
  constexpr size_t kTracks = 400;
  RailNet net;
  for (size_t i = 0; i <= kTracks; ++i) {
    NetTrack& track = net.tracks.emplace_back();
    track.track.name = std::to_string(i);
    track.length_m = i == 0 ? 1000 : 100;
    if (i > 1) net.links.push_back({.a = {i - 1, true}, .b = {i, false}});
  }
  net.tracks[0].slopes = {{0, 0.005}};
  net.links.push_back({.a = {0, false}, .b = {1, false}, .passable = false});
  net.links.push_back({.a = {0, true}, .b = {kTracks, true}, .passable = false});
  const Map map = map_of(net);
  for (const size_t i : {1U, 100U, 200U, 400U}) {
    EXPECT_NEAR(map.edges[i].alignment.at(0).elevation_m, 5.0 * static_cast<double>(i - 1) / kTracks, 1e-6) << i;
  }
}

using RailmlCrossing = ImportTest;

TEST_F(RailmlCrossing, OfRailml2HasSlipsOnlyWhereItSaysSo) {
  const auto text = [](const std::string& type) {
    return R"(<railml version="2.4"><infrastructure><tracks>
<track id="t1"><trackTopology><trackBegin id="b1" pos="0"/><trackEnd id="e1" pos="1000"/><connections>
<crossing id="x" name="X" pos="500" type=")" +
           type + R"("><connection id="c1" ref="c1b" course="left" orientation="outgoing"/>
<connection id="c2" ref="c2b" course="right" orientation="incoming"/></crossing></connections></trackTopology></track>
<track id="t2"><trackTopology><trackBegin id="b2" pos="0"/><trackEnd id="e2" pos="500"><connection id="c2b" ref="c2"/>
</trackEnd></trackTopology></track>
<track id="t3"><trackTopology><trackBegin id="b3" pos="0"><connection id="c1b" ref="c1"/></trackBegin>
<trackEnd id="e3" pos="500"/></trackTopology></track></tracks></infrastructure></railml>)";
  };
  const auto plain = core::value_or_throw(build_map({write("a.railml", text("simpleCrossing"))}, {})).map;
  EXPECT_EQ(plain.connections.size(), 2U);
  EXPECT_THAT(kinds_of(plain), testing::ElementsAre(NodeKind::crossing));
  const auto slips = core::value_or_throw(build_map({write("b.railml", text("doubleSwitchCrossing"))}, {})).map;
  EXPECT_EQ(slips.connections.size(), 4U);
  EXPECT_THAT(kinds_of(slips), testing::ElementsAre(NodeKind::railway_switch));
}

using Railml3Plan = ImportTest;

std::string curve3(const std::string& id, const std::string& attributes, const std::string& place) {
  return "<horizontalCurve id=\"" + id + "\" " + attributes + "><linearLocation>" + place +
         "</linearLocation></horizontalCurve>";
}

std::string arc3(const std::string& id, int radius_m, const std::string& element, int begin_m, int end_m) {
  return curve3(id, "curveType=\"arc\" radius=\"" + std::to_string(radius_m) + "\"",
                on(element, "posBegin=\"" + std::to_string(begin_m) + "\" posEnd=\"" + std::to_string(end_m) + "\""));
}

TEST_F(Railml3Plan, ATransitionLeadsToTheArcOnTheNextNetElement) {
  const std::string infrastructure =
      "<geometryCurves>" + arc3("c1", 1000, "n1", 700, 900) +
      curve3("cl", "curveType=\"clothoid\"", on("n1", "posBegin=\"900\" posEnd=\"1000\"")) +
      arc3("c2", 400, "n2", 0, 200) + arc3("c3", 500, "n2", 700, 800) + "</geometryCurves>";
  const auto curvature = [&](const std::string& text, double at_m) {
    return core::value_or_throw(build_map({write("a.railml", text)}, {})).map.edges[0].alignment.curvature_at(at_m);
  };
  const std::string text = railml3(infrastructure);
  EXPECT_NEAR(curvature(text, 900.001), -1.0 / 1000, 1e-6);
  EXPECT_NEAR(curvature(text, 999.999), -1.0 / 400, 1e-6);
  std::string turned = text;  // n2 ends where n1 does
  const std::string joint = "positionOnB=\"0\"><elementA ref=\"n1\"/><elementB ref=\"n2\"";
  turned.replace(turned.find(joint), joint.size(), "positionOnB=\"1\"><elementA ref=\"n1\"/><elementB ref=\"n2\"");
  EXPECT_NEAR(curvature(turned, 999.999), 1.0 / 500, 1e-6);
}

TEST_F(Railml3Plan, CurvesOnAnotherAreTold) {
  const std::string infrastructure = "<geometryCurves>" + arc3("c1", 1000, "n1", 100, 300) +
                                     arc3("c2", 400, "n1", 150, 250) + arc3("c3", 800, "n1", 300, 400) +
                                     "</geometryCurves>";
  const Map map = core::value_or_throw(build_map({write("a.railml", railml3(infrastructure))}, {})).map;
  EXPECT_THAT(map.problems, testing::Contains("<horizontalCurve> \"c2\" begins on another curve of track n1, which "
                                              "holds up to its own end"));
  EXPECT_THAT(map.problems, testing::Not(testing::Contains(testing::HasSubstr("\"c3\""))));
}

TEST_F(Railml3Plan, CoordinatesThatDoNotReachTheEndsAreNotStretched) {
  const auto map_along = [&](double first, double last) {
    std::string points;
    for (int i = 0; i <= 8; ++i) {
      const double along = first + i * (last - first) / 8;
      points += "<intrinsicCoordinate intrinsicCoord=\"" + std::to_string(along) +
                "\"><geometricCoordinate positioningSystemRef=\"g\" x=\"" + std::to_string(600000 + 1000 * along) +
                "\" y=\"5300000\"/></intrinsicCoordinate>";
    }
    const std::string text =
        "<railML version=\"3.2\"><common><positioning><geometricPositioningSystems><geometricPositioningSystem "
        "id=\"g\" "
        "crsDefinition=\"EPSG:32633\"/></geometricPositioningSystems></positioning></common><infrastructure><topology>"
        "<netElements><netElement id=\"A\" length=\"1000\"><associatedPositioningSystem>" +
        points + "</associatedPositioningSystem></netElement></netElements></topology></infrastructure></railML>";
    return core::value_or_throw(build_map({write("a.railml", text)}, {})).map;
  };
  const auto told = testing::Contains("track A has coordinates, but not from end to end; not used");
  for (const auto& [first, last] : {std::pair(0.1, 1.0), {0.0, 0.9}, {0.1, 0.9}}) {
    const Map map = map_along(first, last);
    EXPECT_THAT(map.problems, told);
    EXPECT_TRUE(map.edges[0].is_drawn);
    EXPECT_EQ(map.crs, "");
  }
  EXPECT_THAT(map_along(0, 1).problems, testing::Not(told));
  EXPECT_EQ(map_along(0, 1).crs, "EPSG:32633");
}

}  // namespace
}  // namespace railfix::track
