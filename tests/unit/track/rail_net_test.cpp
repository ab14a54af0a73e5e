// Trains run over a node where the source says so, whatever the directions of the tracks suggest.
#include <algorithm>
#include <set>

#include "import_fixture.hpp"
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

}  // namespace
}  // namespace railfix::track
