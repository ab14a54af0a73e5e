#include "track/import/network.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <ctime>
#include <set>

#include "core/units.hpp"
#include "small_map.hpp"
#include "track/import/finish.hpp"
#include "track/path.hpp"
#include "track/ways.hpp"

namespace railfix::track {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;

/// A straight main line of 1000 m northwards with a turnout of radius 500 m to the right at 400 m.
std::vector<ImportedTrack> main_and_branch() {
  const Alignment main = Alignment::chained({100, 200, 0}, {{1000, 0, 0}}, {{0, 10, 0}, {1000, 20, 0}});
  const Alignment branch = Alignment::chained(main.at(400).pose, {{120, -1.0 / 500, -1.0 / 500}});
  return {{"main", "main", main, {{LandmarkKind::mast, 600, 3, 0.1, "S1"}}}, {"branch", "branch", branch, {}}};
}

Map built(std::vector<ImportedTrack> tracks, std::vector<std::string>& problems) {
  Map map;
  append(cut_tracks(std::move(tracks), problems), map);
  return map;
}

TEST(Network, CutsTheMainLineAtTheTurnout) {
  std::vector<std::string> problems;
  const Map map = built(main_and_branch(), problems);
  ASSERT_EQ(map.edges.size(), 3U);
  EXPECT_NEAR(map.edges[0].alignment.length_m(), 400, 1e-6);
  EXPECT_NEAR(map.edges[1].alignment.length_m(), 600, 1e-6);
  EXPECT_EQ(map.edges[1].name, "main#2");
  EXPECT_NEAR(map.edges[1].alignment.at(100).elevation_m, 15, 1e-9);
  EXPECT_EQ(map.parse_position("main:450").value().edge, 2U);  // counted over the pieces
  EXPECT_NEAR(map.parse_position("main:450").value().offset_m, 50, 1e-6);
  EXPECT_FALSE(map.parse_position("main:1001").ok());
  EXPECT_FALSE(map.parse_position("1:450").ok());
  ASSERT_EQ(map.connections.size(), 2U);
  EXPECT_EQ(map.connections[0].edge_a, 1U);
  EXPECT_EQ(map.connections[0].edge_b, 2U);
  EXPECT_FALSE(map.connections[0].diverging);
  EXPECT_TRUE(map.connections[1].diverging);
  EXPECT_EQ(map.connections[1].edge_a, 1U);  // the branch is reached from the stem alone
  EXPECT_EQ(map.connections[1].edge_b, 3U);
  ASSERT_EQ(map.landmarks.size(), 1U);
  EXPECT_EQ(map.landmarks[0].edge, 2U);
  EXPECT_NEAR(map.landmarks[0].offset_m, 200, 1e-6);
  EXPECT_THAT(check_topology(map), IsEmpty());
  EXPECT_EQ(problems.size(), 3U);  // both ends of the main line and that of the branch
}

TEST(Network, ConnectsABranchThatIsDrawnTowardsTheTurnout) {
  std::vector<ImportedTrack> tracks = main_and_branch();
  const PlanPose end = tracks[1].alignment.at(120).pose;
  tracks[1].alignment =
      Alignment::chained({end.easting_m, end.northing_m, end.heading_rad + core::kPi}, {{120, 1.0 / 500, 1.0 / 500}});
  std::vector<std::string> problems;
  const auto map = std::make_shared<const Map>(built(tracks, problems));
  ASSERT_EQ(map->connections.size(), 2U);
  const Path path = core::value_or_throw(Path::follow(map, {3, 0, Direction::forward}, 400, 0));
  EXPECT_EQ(path.position_at(400).edge, 1U);
  EXPECT_EQ(path.position_at(400).direction, Direction::reverse);
}

TEST(Network, JoinsEndsThatMeet) {
  const Alignment first = Alignment::chained({0, 0, 1}, {{100, 0, 0.002}});
  const Alignment second = Alignment::chained(first.at(100).pose, {{80, 0.002, 0}});
  std::vector<std::string> problems;
  const Map map = built({{"a", "", first, {}}, {"b", "", second, {}}}, problems);
  EXPECT_EQ(map.edges.size(), 2U);
  ASSERT_EQ(map.connections.size(), 1U);
  EXPECT_EQ(std::count_if(map.nodes.begin(), map.nodes.end(), [](const Node& n) { return n.kind == NodeKind::joint; }),
            1);
}

TEST(Network, TellsTheNeighbourOfALooseEnd) {
  std::vector<ImportedTrack> tracks = main_and_branch();
  tracks[1].alignment = Alignment::chained({101, 600, 0}, {{120, -1.0 / 500, -1.0 / 500}});
  std::vector<std::string> problems;
  const Map map = built(tracks, problems);
  EXPECT_THAT(problems,
              testing::Contains(HasSubstr("the start of branch is not connected; the nearest track, main, is 1.0")));
  EXPECT_THAT(check_topology(map), testing::Contains(HasSubstr("ends loose")));
}

// A stem, and a loop of three arcs whose ends both meet it.
TEST(Ways, OfABalloonLoopAreTwoInAndOneOut) {
  constexpr double kRadiusM = 200;
  constexpr double kThirdM = kRadiusM * core::kPi / 3;
  Map map;
  map.nodes = {{1, NodeKind::end, "", 0, 0}, {2, NodeKind::railway_switch, "", 500, 0}};
  map.edges.push_back({1, "stem", 1, 2, "1", Alignment::chained({0, 0, core::kPi / 2}, {{500, 0, 0}})});
  map.edges.push_back({2, "loop", 2, 2, "1",
                       Alignment::chained({500, 0, core::kPi / 2}, {{kThirdM, -1 / kRadiusM, -1 / kRadiusM},
                                                                    {5 * kThirdM, 1 / kRadiusM, 1 / kRadiusM},
                                                                    {kThirdM, -1 / kRadiusM, -1 / kRadiusM}})});
  map.connections = {{2, 1, 2, false}, {2, 1, 2, true}};
  const Ways ways(map);
  EXPECT_EQ(ways.after({&map.edges[0], true}).size(), 2U);
  const auto& out = ways.after({&map.edges[1], true});
  ASSERT_EQ(out.size(), 1U);
  EXPECT_EQ(out[0].edge->id, 1U);
  EXPECT_FALSE(out[0].forward);
}

TEST(Slice, HasTheSameGeometry) {
  const Alignment line = Alignment::chained({0, 0, 0.5}, {{100, 0, 0}, {60, 0, 0.004}, {200, 0.004, 0.004}},
                                            {{0, 1, 0}, {150, 4, 60}, {360, 2, 0}}, {{100, 0}, {160, 0.1}});
  const Alignment part = slice(line, 130, 250);
  EXPECT_NEAR(part.length_m(), 120, 1e-9);
  for (double s = 0; s <= 120; s += 3) {
    const TrackPoint a = line.at(130 + s);
    const TrackPoint b = part.at(s);
    EXPECT_NEAR(a.pose.easting_m, b.pose.easting_m, 1e-9);
    EXPECT_NEAR(a.curvature_per_m, b.curvature_per_m, 1e-15);
    EXPECT_NEAR(a.elevation_m, b.elevation_m, 1e-9);
    EXPECT_NEAR(a.cant_m, b.cant_m, 1e-12);
  }
}

TEST(Frogs, LieWhereTheGaugeFacesOfTheInnerRailsCross) {
  std::vector<std::string> problems;
  Map map = built(main_and_branch(), problems);
  add_frogs(map, 0.3);
  ASSERT_EQ(map.landmarks.size(), 3U);
  const double half_m = 1.435 / 2;
  const double angle = std::acos((500 - half_m) / (500 + half_m));
  EXPECT_NEAR(map.landmarks[1].offset_m, (500 + half_m) * std::sin(angle), 1e-6);  // on the main line
  EXPECT_NEAR(map.landmarks[1].lateral_m, -1.435 / 2, 1e-9);                       // towards the branch, to the right
  EXPECT_EQ(map.landmarks[1].edge, 2U);
  EXPECT_NEAR(map.landmarks[2].offset_m, 500 * angle, 1e-6);
  EXPECT_NEAR(map.landmarks[2].lateral_m, 1.435 / 2, 1e-9);
  EXPECT_EQ(map.landmarks[2].edge, 3U);
}

TEST(Frogs, OfEachFurtherInputComeOnce) {
  std::vector<std::string> problems;
  Map map = built(main_and_branch(), problems);
  add_frogs(map, 0.3);
  const size_t frogs = map.landmarks.size();
  const size_t first = map.nodes.size();
  append(cut_tracks({{"other", "other", Alignment::chained({5000, 0, 0}, {{100, 0, 0}}), {}}}, problems), map);
  add_frogs(map, 10, first);
  EXPECT_EQ(map.landmarks.size(), frogs);
}

TEST(VirtualBalises, AreSpreadAlongTheEdges) {
  Map map = small_map();
  map.balise_groups.clear();
  ASSERT_TRUE(add_virtual_balises(map, 300, {{7}, 20}, 5).ok());
  ASSERT_EQ(map.balise_groups.size(), 8U);  // 3 + 3 + 2
  EXPECT_EQ(map.balise_groups[0].nid_bg, 20U);
  EXPECT_EQ(map.balise_groups[7].nid_bg, 27U);
  EXPECT_NEAR(map.balise_groups[1].offset_m, 500, 1e-9);
  EXPECT_TRUE(map.balise_groups[0].is_virtual);
  // A second time they go on behind the first; another country counts for itself.
  const size_t once = map.balise_groups.size();
  ASSERT_TRUE(add_virtual_balises(map, 200, {{7}, 20}, 5).ok());
  ASSERT_TRUE(add_virtual_balises(map, 140, {{8}, 20}, 5).ok());
  EXPECT_EQ(map.balise_groups[once].nid_bg, map.balise_groups[once - 1].nid_bg + 1);
  std::set<uint32_t> identities;
  for (const BaliseGroup& group : map.balise_groups) identities.insert(group.nid_lrbg());
  EXPECT_EQ(identities.size(), map.balise_groups.size());
  EXPECT_TRUE(identities.contains(8U << 14U | 20U));
  EXPECT_FALSE(add_virtual_balises(map, 0, {{7}, 1}, 5).ok());
  EXPECT_FALSE(add_virtual_balises(map, 300, {{1024}, 1}, 5).ok());
}

TEST(VirtualBalises, StandNotWhereAGroupIs) {
  Map map = small_map();
  map.balise_groups[0].offset_m = 492;  // 500 is one of the places
  map.balise_groups[1].offset_m = 120;  // 125 is
  ASSERT_TRUE(add_virtual_balises(map, 250, {{77}, 1}, 5).ok());
  EXPECT_EQ(map.balise_groups.size(), 2U + 4 + 3 + 1);
  map = small_map();
  map.balise_groups[0].offset_m = 489;
  ASSERT_TRUE(add_virtual_balises(map, 1000, {{77}, 1}, 5).ok());
  EXPECT_EQ(map.balise_groups.back().edge, 3U);
  EXPECT_THAT(check_topology(map), IsEmpty());
}

TEST(VirtualBalises, EdgesTooShortForThemAreCounted) {
  Map map = small_map();
  const VirtualBalises all = core::value_or_throw(add_virtual_balises(map, 300, {{77}, 1}, 5));
  EXPECT_EQ(all.groups, map.balise_groups.size() - 2);
  EXPECT_EQ(all.short_edges, 0U);
  const VirtualBalises some = core::value_or_throw(add_virtual_balises(map, 1900, {{77}, 1}, 5));
  EXPECT_EQ(some.short_edges, 2U);
  EXPECT_NEAR(some.short_m, map.edges[1].alignment.length_m() + map.edges[2].alignment.length_m(), 1e-9);
}

TEST(VirtualBalises, TooManyNeedOneMoreCountry) {
  Map map = small_map();
  const auto refusal = [&](double every_m, const GroupNumbers& numbers) {
    return add_virtual_balises(map, every_m, numbers, 5).error().message;
  };
  EXPECT_EQ(refusal(100, {{85}, 16373}),
            "22 virtual balise groups are more than NID_C 85 has numbers for: 10 are free from 16373 on; begin at a "
            "lower NID_BG, give one more NID_C (as in --nid-c 85,86) or place fewer");
  EXPECT_THAT(refusal(100, {{85, 85}, 16373}), HasSubstr("10 are free")) << "a country given twice is one";
  EXPECT_EQ(map.balise_groups.size(), 2U) << "none is added";
  ASSERT_TRUE(add_virtual_balises(map, 100, {{85, 86}, 16373}, 5).ok());
  EXPECT_EQ(map.balise_groups[2].nid_lrbg(), 85U << 14U | 16373U);
  EXPECT_EQ(map.balise_groups[11].nid_lrbg(), 85U << 14U | 16382U);
  EXPECT_EQ(map.balise_groups[12].nid_lrbg(), 86U << 14U | 1U);
  EXPECT_THAT(check_topology(map), IsEmpty());
}

TEST(VirtualBalises, StandWhereTheyAreWanted) {
  Map map = small_map();
  const auto at = [&](const std::vector<std::string>& places) {
    return add_virtual_balises_at(map, places, {{77}, 5}, 3);
  };
  ASSERT_TRUE(at({"1:400", "2:100.5:-"}).ok());
  ASSERT_EQ(map.balise_groups.size(), 4U);
  EXPECT_EQ(map.balise_groups[2].nid_lrbg(), 77U << 14U | 5U);
  EXPECT_EQ(map.balise_groups[3].edge, 2U);
  EXPECT_NEAR(map.balise_groups[3].offset_m, 100.5, 1e-9);
  EXPECT_TRUE(map.balise_groups[3].is_virtual);
  EXPECT_TRUE(map.balise_groups[2].nominal_is_forward);
  EXPECT_FALSE(map.balise_groups[3].nominal_is_forward);
  EXPECT_EQ(at({"1:300", "1:405"}).error().message, "a balise group is within 10 m of 1:405 already");
  EXPECT_THAT(at({"1:300", "99:5"}).error().message, HasSubstr("99"));
  EXPECT_EQ(map.balise_groups.size(), 4U) << "none is added";
}

TEST(Landmarks, AreKeptByTheirKind) {
  Map map = small_map();
  map.landmarks = {{1, LandmarkKind::mast, 1, 10, 3, 0, "mast"},
                   {2, LandmarkKind::balise, 1, 20, 0, 0, "balise 1"},
                   {3, LandmarkKind::frog, 1, 30, 0, 0, "frog"},
                   {4, LandmarkKind::balise, 1, 23, 0, 0, "balise 2"}};
  map.balise_groups.assign(1, {.edge = 1, .balises = {2, 4}});
  EXPECT_FALSE(keep_landmarks(map, {"balice"}).ok());
  ASSERT_TRUE(keep_landmarks(map, {"balise"}).ok());
  ASSERT_EQ(map.landmarks.size(), 2U);
  EXPECT_EQ(map.landmarks[1].id, 2U);
  EXPECT_EQ(map.landmarks[1].name, "balise 2");
  EXPECT_THAT(map.balise_groups[0].balises, testing::ElementsAre(1, 2));
  ASSERT_TRUE(keep_landmarks(map, {"frog"}).ok());
  EXPECT_TRUE(map.landmarks.empty());
  EXPECT_THAT(map.balise_groups[0].balises, testing::ElementsAre(0, 0)) << "still a group of two";
}

TEST(Check, FindsNothingInASoundMap) {
  EXPECT_THAT(check_topology(small_map()), IsEmpty());
}

TEST(Check, NamesWhatIsWrong) {
  Map map = small_map();
  map.balise_groups.push_back(map.balise_groups[0]);
  map.balise_groups.back().edge = 3;
  map.balise_groups.back().offset_m = 70;
  EXPECT_THAT(check_topology(map),
              testing::Contains(HasSubstr(
                  "balise group 85/100 is there twice, edge 1 (main) at 900.00 m and edge 3 (siding) at 70.00 m")));
  map = small_map();
  map.connections.pop_back();
  EXPECT_THAT(check_topology(map), testing::Contains(HasSubstr("edge 3 (siding) is not connected")));
  map = small_map();
  map.edges[1].from_node = 4;
  EXPECT_THAT(check_topology(map),
              testing::Contains(testing::ContainsRegex(
                  "edge 2 .on. ends [0-9.]+ m from its node 4, which it shares with edge 3 .siding.$")));
  map = small_map();
  map.edges[0].alignment =
      Alignment({{500, 0, 0}, {500, 0, 0}},
                {{2680000, 1250000, core::kPi / 2}, {2680500, 1250000.2, core::kPi / 2 + 0.1}}, {}, {});
  EXPECT_THAT(check_topology(map), testing::Contains(HasSubstr("a gap of 0.20 m")));
  EXPECT_THAT(check_topology(map), testing::Contains(HasSubstr("has a kink of 5.7 degrees")));
  map = small_map();
  map.edges[2].from_node = 77;
  EXPECT_THAT(check_topology(map), testing::Contains(HasSubstr("node 77, which does not exist")));
  map = small_map();
  const auto& main = map.edges[0].alignment;
  map.edges[0].alignment = Alignment(main.elements(), main.starts(), {}, {{0, 0}, {1000, -0.4}});
  EXPECT_THAT(check_topology(map), testing::Contains(HasSubstr("edge 1 (main) at 1000.00 m has a cant of -0.40 m")));
}

TEST(Check, NamesBalisesThatAreThereTwice) {
  Map map = small_map();
  map.landmarks.push_back({4, LandmarkKind::balise, 1, 900.3, 0, 0.1, ""});
  EXPECT_THAT(check_topology(map),
              testing::ElementsAre("balises \"B1\" and (no name) are at the same place, edge 1 (main) at 900.30 m"));
}

TEST(Check, NamesBalisesThatAreThereTwiceAcrossAJoint) {
  Map map = small_map();
  map.balise_groups.clear();
  map.landmarks = {{1, LandmarkKind::balise, 1, 999.9, 0, 0.1, "B1"}, {2, LandmarkKind::balise, 2, 0.1, 0, 0.1, "B2"}};
  EXPECT_THAT(check_topology(map),
              testing::ElementsAre("balises \"B1\" and \"B2\" are at the same place, edge 1 (main) at 999.90 m and "
                                   "edge 2 (on) at 0.10 m"));
  map.landmarks[1].edge = 3;  // runs towards the switch
  EXPECT_THAT(check_topology(map), testing::IsEmpty());
  map.landmarks[1].offset_m = 499.9;
  EXPECT_EQ(check_topology(map).size(), 1U);
  map.landmarks[1].offset_m = 499.4;
  EXPECT_THAT(check_topology(map), testing::IsEmpty());
  map.balise_groups = {{85, 100, 1, 1000, true, false, 5, {}}, {85, 101, 2, 0, true, true, 5, {}}};
  EXPECT_THAT(check_topology(map), testing::ElementsAre(HasSubstr("balise groups 85/100 and 85/101 are at the same")));
}

TEST(Check, NamesADanglingSwitchAsItsSourceDoes) {
  Map map = small_map();
  map.edges.pop_back();
  map.connections.pop_back();
  map.balise_groups.clear();
  map.nodes.pop_back();
  const auto dangling = [&] { return check_topology(map).front(); };
  EXPECT_EQ(dangling(),
            "switch \"W1\" at latitude 47.395843, longitude 8.511572 has only two tracks, the end of edge 1 (main) and "
            "the start of edge 2 (on)");
  map.nodes[1].name.clear();
  map.crs.clear();
  EXPECT_EQ(dangling(),
            "a switch without a name at easting 2681000.00 m, northing 1250000.00 m has only two tracks, the end of "
            "edge 1 (main) and the start of edge 2 (on)");
  map.edges[0].is_drawn = map.edges[1].is_drawn = true;
  EXPECT_THAT(dangling(), testing::StartsWith("a switch without a name has only two tracks"));
  map.edges.pop_back();
  map.connections.clear();
  map.nodes.pop_back();
  EXPECT_THAT(dangling(), testing::EndsWith("has only one track, the end of edge 1 (main)"));
}

/// Tracks of 60 m beside each other, the last 10 m of each a curve of this radius.
Map with_radii(const std::vector<double>& radii_m) {
  Map map;
  for (uint32_t i = 0; i < radii_m.size(); ++i) {
    const PlanPose begin{100.0 * i, 0, 0};
    const Alignment track = Alignment::chained(begin, {{50, 0, 0}, {10, 1 / radii_m[i], 1 / radii_m[i]}});
    const PlanPose end = track.at(60).pose;
    map.edges.push_back({i + 1, "t" + std::to_string(i + 1), 2 * i + 1, 2 * i + 2, "", track});
    map.nodes.push_back({2 * i + 1, NodeKind::end, "", begin.easting_m, begin.northing_m});
    map.nodes.push_back({2 * i + 2, NodeKind::end, "", end.easting_m, end.northing_m});
  }
  return map;
}

TEST(Check, WhatCutsTheNetworkComesFirstAndManyRadiiAreCounted) {
  Map map = with_radii({70, 500, 40, 50, 60, 30, 79});
  map.edges.back().name = "long";
  map.edges.back().alignment = Alignment::chained({600, 0, 0}, {{150, 0, 0}, {10, 1.0 / 79, 1.0 / 79}});
  const PlanPose end = map.edges.back().alignment.at(160).pose;
  map.nodes.back() = {14, NodeKind::end, "", end.easting_m, end.northing_m};
  const std::vector<std::string> told = check_topology(map);
  ASSERT_EQ(told.size(), 10U);
  EXPECT_EQ(told[0], "edge 1 (t1), 60.00 m, cannot be reached from the rest of the network")
      << "the longest is the rest";
  EXPECT_EQ(told[6], "edge 6 (t6) at 50.00 m has a radius of only 30.00 m");
  EXPECT_EQ(told[8], "edge 4 (t4) at 50.00 m has a radius of only 50.00 m");
  EXPECT_EQ(told[9], "3 more of 7 edges have a radius of 60.00 m to 79.00 m");
  EXPECT_THAT(check_topology(with_radii({70, 40})),
              testing::IsSupersetOf({"edge 2 (t2) at 50.00 m has a radius of only 40.00 m",
                                     "edge 1 (t1) at 50.00 m has a radius of only 70.00 m"}));
}

TEST(Check, TheLongestLostPartComesFirst) {
  Map map = with_radii({500, 500, 500});
  const auto lengthen = [&](size_t edge, double by_m) {
    const PlanPose begin = map.edges[edge].alignment.at(0).pose;
    map.edges[edge].alignment = Alignment::chained(begin, {{by_m, 0, 0}});
    map.nodes[2 * edge + 1].easting_m = begin.easting_m;
    map.nodes[2 * edge + 1].northing_m = by_m;
  };
  lengthen(1, 900);
  lengthen(2, 200);
  EXPECT_THAT(check_topology(map), testing::ElementsAre(HasSubstr("edge 3 (t3), 200.00 m, cannot"),
                                                        HasSubstr("edge 1 (t1), 60.00 m, cannot")));
}

// Loose ends have their neighbour told, which was sought along every track.
TEST(Network, ManyTracksAreCutInTheTimeOfMany) {
  std::vector<ImportedTrack> tracks;
  for (int i = 0; i < 2000; ++i) {
    const PlanPose start{10.0 * (i % 100), 1100.0 * (i / 100), 0};
    tracks.push_back({std::to_string(i), "", Alignment::chained(start, std::vector<Element>(5, {200, 0, 0})), {}});
  }
  std::vector<std::string> problems;
  const std::clock_t begin = std::clock();
  EXPECT_EQ(cut_tracks(std::move(tracks), problems).edges.size(), 2000U);
  EXPECT_LT(std::clock() - begin, 2 * CLOCKS_PER_SEC);
  EXPECT_EQ(problems.size(), 4000U);
  EXPECT_EQ(problems.front(), "the start of 0 is not connected; the nearest track, 1, is 10.00 m away");
}

}  // namespace
}  // namespace railfix::track
