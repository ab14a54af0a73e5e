#include "track/import/meeting.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/units.hpp"
#include "import_fixture.hpp"
#include "small_map.hpp"
#include "track/import/build.hpp"
#include "track/import/finish.hpp"

namespace railfix::track {
namespace {

using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

/// Tracks that meet nowhere, each with two nodes of its own.
Map apart(const std::vector<Alignment>& tracks) {
  Map map;
  const auto node = [&](const PlanPose& pose) {
    const auto id = static_cast<uint32_t>(map.nodes.size() + 1);
    map.nodes.push_back({id, NodeKind::end, "", pose.easting_m, pose.northing_m});
    return id;
  };
  for (const Alignment& track : tracks) {
    const uint32_t from = node(track.at(0).pose);
    const uint32_t to = node(track.at(track.length_m()).pose);
    const auto id = static_cast<uint32_t>(map.edges.size() + 1);
    map.edges.push_back({id, "t" + std::to_string(id), from, to, "", track});
  }
  return map;
}

/// Northwards from there.
Alignment straight(double easting_m, double northing_m) {
  return Alignment::chained({easting_m, northing_m, 0}, {{100, 0, 0}});
}

TEST(FacingEnds, AGapInLineIsTold) {
  for (const double gap_m : {2.0, 5.0, 20.0, 49.0}) {
    const Map map = apart({straight(0, 0), straight(0.5, 100 + gap_m)});
    EXPECT_THAT(facing_ends(map), ElementsAre(HasSubstr("edge 1 (t1) and edge 2 (t2) end loose at nodes 2 and 3, in "
                                                        "line and " +
                                                        std::to_string(static_cast<int>(gap_m)) + ".")));
    EXPECT_THAT(check_topology(map), Contains(HasSubstr("in line and")));
  }
  EXPECT_THAT(facing_ends(apart({straight(0, 0), straight(0, 151)})), IsEmpty());
}

TEST(FacingEnds, WhicheverWayTheTracksAreDrawn) {
  const Alignment back = Alignment::chained({0, 220, core::kPi}, {{100, 0, 0}});
  EXPECT_THAT(facing_ends(apart({back, straight(0, 0)})), ElementsAre(HasSubstr("20.00 m apart")));
}

TEST(FacingEnds, AGapInACurveIsTold) {
  const Element arc{100, 1.0 / 300, 1.0 / 300};
  const PlanPose start{0, 0, 1};
  const Map map = apart({Alignment::chained(start, {arc}), Alignment::chained(advance(start, arc, 140), {arc})});
  EXPECT_THAT(facing_ends(map), ElementsAre(HasSubstr("39.97 m apart")));
}

TEST(FacingEnds, AGapInARingIsTold) {
  const double per_m = 2 * core::kPi / 2000;
  for (const double gap_m : {1.0, 20.0})
    EXPECT_EQ(facing_ends(apart({Alignment::chained({0, 0, 0}, {{2000 - gap_m, per_m, per_m}})})).size(), 1U);
}

TEST(FacingEnds, ManyAroundATurntableAreToldByPairs) {
  const auto ray = [](double from_north_deg) {
    const double heading = core::rad_from_deg(from_north_deg);
    return Alignment::chained({11 * std::sin(heading), 11 * std::cos(heading), heading}, {{50, 0, 0}});
  };
  EXPECT_EQ(facing_ends(apart({ray(180), ray(-7), ray(0.5), ray(7)})).size(), 1U);
}

TEST(FacingEnds, OtherEndsAreNot) {
  EXPECT_THAT(facing_ends(apart({straight(0, 0), straight(3.5, 140)})), IsEmpty()) << "the next track's buffer stop";
  EXPECT_THAT(facing_ends(apart({straight(0, 0), straight(0, 60)})), IsEmpty()) << "beside each other";
  EXPECT_THAT(facing_ends(apart({straight(0, 0), Alignment::chained({0, 110, 0.3}, {{100, 0, 0}})})), IsEmpty());
  EXPECT_THAT(facing_ends(apart({straight(0, 0), straight(0, 101)})), IsEmpty()) << "a near miss, told as such";
  EXPECT_THAT(facing_ends(small_map()), IsEmpty());
}

/// Beside a long track that runs north on easting 0: one of 100 m that ends `apart_m` east of it, turned towards it by
/// so much.
Map beside(double apart_m, double turn_deg) {
  const double heading = core::rad_from_deg(-turn_deg);
  const PlanPose end{apart_m, 500, heading};
  const PlanPose start = advance(end, {100, 0, 0}, -100);
  return apart({Alignment::chained({0, 0, 0}, {{1000, 0, 0}}), Alignment::chained(start, {{100, 0, 0}})});
}

TEST(NearMisses, AnEndSoNearToATrackIsToldWhateverItsDirection) {
  for (const double turn_deg : {-90.0, 0.0, 5.0, 90.0}) {
    EXPECT_THAT(near_misses(beside(0.3, turn_deg)),
                Contains("edge 2 (t2) ends loose at node 4, only 0.30 m from edge 1 (t1)"))
        << turn_deg;
  }
}

TEST(NearMisses, ABranchThatStopsShortOfItsSwitchIsTold) {
  EXPECT_THAT(near_misses(beside(2.4, 6)),
              ElementsAre("edge 2 (t2) ends loose at node 4, only 2.40 m from edge 1 (t1) and turned towards it by 6.0 "
                          "degrees: draw the switch between them, unless it is a buffer stop"));
  for (const double apart_m : {-2.4, 2.4}) {  // on either side, and whichever way the tracks are drawn
    Map map = beside(apart_m, std::copysign(6, apart_m));
    EXPECT_EQ(near_misses(map).size(), 1U);
    map.edges[0].alignment = Alignment::chained({0, 1000, core::kPi}, {{1000, 0, 0}});
    EXPECT_EQ(near_misses(map).size(), 1U);
    const PlanPose end = turned_round(map.edges[1].alignment.at(100).pose);
    map.edges[1].alignment = Alignment::chained(end, {{100, 0, 0}});
    std::swap(map.edges[1].from_node, map.edges[1].to_node);
    EXPECT_EQ(near_misses(map).size(), 1U);
  }
}

TEST(NearMisses, AnEndAtASwitchOfTheSourceIsOneToo) {
  Map map = beside(2.4, 6);
  map.nodes[3].kind = NodeKind::railway_switch;
  EXPECT_EQ(near_misses(map).size(), 1U);
}

TEST(NearMisses, BufferStopsAreNot) {
  for (const double apart_m : {3.5, 4.0, 4.7, 9.0})
    for (const double turn_deg : {0.0, 0.5, 2.0})
      EXPECT_THAT(near_misses(beside(apart_m, turn_deg)), IsEmpty()) << apart_m << " m, " << turn_deg << " degrees";
  EXPECT_THAT(near_misses(beside(2.4, -6)), testing::Not(Contains(HasSubstr("node 4")))) << "turned away";
  EXPECT_THAT(near_misses(beside(5, 90)), IsEmpty()) << "before a track that lies across";
  for (const double turn_deg : {6, 9, 14})
    EXPECT_THAT(near_misses(beside(3.5, turn_deg)), IsEmpty()) << "in a yard, before the track of the switches";
  EXPECT_THAT(near_misses(small_map()), IsEmpty());
}

TEST(NearMisses, TheNearestIsToldOnce) {
  const Map map = apart({straight(0, 0), straight(0.5, 0), straight(1.2, 50)});
  EXPECT_THAT(near_misses(map),
              testing::Contains(HasSubstr("edge 3 (t3) ends loose at node 5, only 0.70 m from edge 2")));
  EXPECT_EQ(near_misses(map).size(), 3U)
      << "of two ends beside each other one; not the one that left the others behind";
}

TEST(NearMisses, ADrawingHasNone) {
  Map map = beside(0.3, 5);
  map.edges[0].is_drawn = true;
  EXPECT_THAT(near_misses(map), IsEmpty());
}

/// Pairs of tracks that meet, the second turned by so much.
Map bent(const std::vector<double>& turns_deg) {
  std::vector<Alignment> tracks;
  for (size_t i = 0; i < turns_deg.size(); ++i) {
    const double easting_m = 1000.0 * static_cast<double>(i);
    tracks.push_back(straight(easting_m, 0));
    tracks.push_back(Alignment::chained({easting_m, 100, core::rad_from_deg(turns_deg[i])}, {{100, 0, 0}}));
  }
  Map map = apart(tracks);
  for (uint32_t edge = 1; edge < map.edges.size(); edge += 2) {
    map.edges[edge].from_node = map.edges[edge - 1].to_node;
    map.connections.push_back({map.edges[edge].from_node, edge, edge + 1, false});
  }
  return map;
}

TEST(KinksAtNodes, TheWorstAreToldByName) {
  EXPECT_THAT(kinks_at_nodes(bent({3, 1.5, -7})),
              ElementsAre(HasSubstr("edge 5 (t5) and edge 6 (t6) meet at node 10 with a kink of 7.0 degrees"),
                          HasSubstr("edge 1 (t1) and edge 2 (t2) meet at node 2 with a kink of 3.0 degrees")));
  EXPECT_THAT(check_topology(bent({3})), Contains(HasSubstr("with a kink of 3.0 degrees")));
}

TEST(KinksAtNodes, ManyAreCounted) {
  std::vector<double> turns_deg(14, 4);
  turns_deg.back() = 2.5;
  const std::vector<std::string> told = kinks_at_nodes(bent(turns_deg));
  ASSERT_EQ(told.size(), 11U);
  EXPECT_THAT(told.back(), HasSubstr("4 more of 14 ways over nodes have a kink of 2.5 degrees to 4.0 degrees"));
}

TEST(KinksAtNodes, DivergingWaysCountAndRoundOnesAreSound) {
  EXPECT_THAT(kinks_at_nodes(small_map()), IsEmpty());
  Map map = small_map();
  const PlanPose end = map.edges[2].alignment.at(500).pose;
  map.edges[2].alignment = Alignment::chained(
      turned_round(advance({end.easting_m, end.northing_m, end.heading_rad + 3.05}, {500, 0, 0}, 500)), {{500, 0, 0}});
  EXPECT_THAT(kinks_at_nodes(map), ElementsAre(HasSubstr("edge 1 (main) and edge 3 (siding) meet at node 2")));
  Map ring = apart({Alignment::chained({0, 0, 0}, {{2000, core::kPi / 1000, core::kPi / 1000}})});
  ring.edges[0].to_node = 1;
  ring.connections = {{1, 1, 1, false}};
  EXPECT_THAT(kinks_at_nodes(ring), IsEmpty());
}

TEST(LyingOnOthers, OneTrackThatIsThereTwiceIsTold) {
  const Alignment line = Alignment::chained({0, 0, 0}, {{1000, 0, 0}});
  const PlanPose at_300 = line.at(300).pose;
  const Alignment branch = Alignment::chained(at_300, {{300, 0, 0}, {200, 1.0 / 300, 1.0 / 300}});
  EXPECT_THAT(lying_on_others(apart({line, branch})),
              ElementsAre("edge 2 (t2) lies on edge 1 (t1) from 0.00 m to 300.00 m: one track is there twice; leave "
                          "one of them out"));
  const PlanPose end = line.at(1000).pose;
  const Map twice = apart({line, Alignment::chained(turned_round(end), {{1000, 0, 0}})});
  EXPECT_THAT(check_topology(twice), Contains(HasSubstr("edge 2 (t2) lies on edge 1 (t1) from 0.00 m to 1000.00 m")));
}

TEST(LyingOnOthers, BranchesCrossingsAndTheNextTrackAreSound) {
  const Alignment line = Alignment::chained({0, 0, 0}, {{1000, 0, 0}});
  const Alignment branch = Alignment::chained(line.at(300).pose, {{300, 1.0 / 2500, 1.0 / 2500}});
  const Alignment across = Alignment::chained({-100, 400, 1.5}, {{200, 0, 0}});
  EXPECT_THAT(lying_on_others(apart({line, branch, across, straight(4, 0)})), IsEmpty());
  // A loop meets its line at both ends.
  EXPECT_THAT(lying_on_others(apart(
                  {Alignment::chained({0, 0, 0}, {{800, 0, 0}}),
                   Alignment::chained({0, 0, 0}, {{200, 0.001, 0.001}, {400, -0.001, -0.001}, {200, 0.001, 0.001}})})),
              IsEmpty());
  Map drawn = apart({line, line});
  drawn.edges[1].is_drawn = true;
  EXPECT_THAT(lying_on_others(drawn), IsEmpty());
  EXPECT_THAT(lying_on_others(small_map()), IsEmpty());
}

using NotJoinedTest = ImportTest;

std::string track_between(const std::string& from_deg, const std::string& to_deg) {
  return R"({"features":[{"type":"Feature","properties":{"railway":"rail"},
"geometry":{"type":"LineString","coordinates":[[)" +
         from_deg + ",48.0],[" + to_deg + ",48.0]]}}]}";
}

TEST_F(NotJoinedTest, WhatTouchesACompiledMapIsToldFirst) {
  const auto west = write("west.geojson", track_between("15.0", "15.01"));
  const auto east = write("east.geojson", track_between("15.01", "15.02"));
  const auto away = write("away.geojson", track_between("15.1", "15.12"));
  const auto compiled = in_folder("west.map");
  ASSERT_TRUE(core::value_or_throw(build_map({west}, {})).map.save(compiled).ok());
  const auto problems = [](const std::vector<std::filesystem::path>& inputs) {
    return core::value_or_throw(build_map(inputs, {})).map.problems;
  };
  EXPECT_THAT(problems({compiled, east}).front(),
              HasSubstr("1 ends of one input's tracks lie on those of another and are not joined"));
  EXPECT_THAT(problems({west, east}), IsEmpty());
  EXPECT_THAT(problems({compiled, away}), ElementsAre(HasSubstr("cannot be reached")));
}

}  // namespace
}  // namespace railfix::track
