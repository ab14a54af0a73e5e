#include "track/path.hpp"

#include <gtest/gtest.h>

#include "small_map.hpp"
#include "track/same_map.hpp"

namespace railfix::track {
namespace {

std::shared_ptr<const Map> shared_small_map() {
  return std::make_shared<const Map>(small_map());
}

Path path_from(const EdgePosition& start, double ahead_m, double behind_m) {
  return core::value_or_throw(Path::follow(shared_small_map(), start, ahead_m, behind_m));
}

TEST(Path, GoesStraightOverTheSwitch) {
  const Path path = path_from({1, 200, Direction::forward}, 1200, 500);
  EXPECT_DOUBLE_EQ(path.begin_m(), -200);
  EXPECT_DOUBLE_EQ(path.end_m(), 1200);
  EXPECT_EQ(path.position_at(900).edge, 2U);
  EXPECT_NEAR(path.position_at(900).offset_m, 100, 1e-9);
  EXPECT_NEAR(path.curvature_at(900), 1.0 / 500, 1e-15);
  EXPECT_EQ(path.position_at(5000).edge, 2U);
  EXPECT_EQ(*path.distance_of(2, 100), 900);
  EXPECT_FALSE(path.distance_of(3, 100));
  EXPECT_FALSE(path.distance_of(2, 700));  // beyond 1200 m ahead
}

TEST(Path, MayBeginInsideAnEdgeAheadAndBehind) {
  const Path path = path_from({1, 500, Direction::forward}, 100, 50);
  EXPECT_DOUBLE_EQ(path.begin_m(), -50);
  EXPECT_DOUBLE_EQ(path.end_m(), 100);
  EXPECT_DOUBLE_EQ(path.position_at(-50).offset_m, 450);
}

TEST(Path, RunsFromTheSidingOntoTheMainLineBackwards) {
  const Path path = path_from({3, 400, Direction::forward}, 600, 1000);
  EXPECT_DOUBLE_EQ(path.begin_m(), -400);
  EXPECT_DOUBLE_EQ(path.end_m(), 600);
  const EdgePosition end = path.position_at(600);
  EXPECT_EQ(end.edge, 1U);
  EXPECT_NEAR(end.offset_m, 500, 1e-9);
  EXPECT_EQ(end.direction, Direction::reverse);

  const TrackPoint on_main = path.at(300);  // 800 m along edge 1, westwards
  EXPECT_NEAR(core::wrap_pi(on_main.pose.heading_rad + core::kPi / 2), 0, 1e-12);
  EXPECT_NEAR(on_main.cant_m, -0.08, 1e-12);
  EXPECT_NEAR(on_main.twist, 1e-4, 1e-15);
  EXPECT_NEAR(on_main.grade, -0.01, 1e-15);
}

TEST(Path, SignsTurnRoundOnAReversedEdge) {
  const Path forward = path_from({2, 0, Direction::forward}, 800, 0);
  const Path reverse = path_from({2, 800, Direction::reverse}, 800, 0);
  for (double s = 0; s <= 800; s += 40) {
    const TrackPoint a = forward.at(s);
    const TrackPoint b = reverse.at(800 - s);
    EXPECT_NEAR(a.pose.easting_m, b.pose.easting_m, 1e-9);
    EXPECT_NEAR(a.curvature_per_m, -b.curvature_per_m, 1e-15);
    EXPECT_NEAR(std::abs(core::wrap_pi(a.pose.heading_rad - b.pose.heading_rad)), core::kPi, 1e-9);
  }
}

TEST(Path, PositionIsContinuousOverEveryJoint) {
  const Path path = path_from({3, 250, Direction::forward}, 2000, 2000);
  for (double s = path.begin_m(); s + 1 <= path.end_m(); s += 1) {
    const PlanPose a = path.at(s).pose;
    const PlanPose b = path.at(s + 1).pose;
    EXPECT_NEAR(std::hypot(a.easting_m - b.easting_m, a.northing_m - b.northing_m), 1, 1e-4);
    EXPECT_LT(std::abs(core::wrap_pi(a.heading_rad - b.heading_rad)), 0.01);
  }
}

TEST(Path, ListsMarksByDistanceAsSeenAlongThePath) {
  const Path path = path_from({1, 600, Direction::reverse}, 600, 10000);  // from the straight way behind
  ASSERT_EQ(path.landmarks().size(), 2U);
  EXPECT_NEAR(path.landmarks()[0].distance_m, -300, 1e-9);  // the balise behind
  EXPECT_NEAR(path.landmarks()[1].distance_m, 300, 1e-9);
  EXPECT_NEAR(path.landmarks()[1].lateral_m, 3, 1e-12);
  ASSERT_EQ(path.balise_groups().size(), 1U);
  EXPECT_FALSE(path.balise_groups()[0].nominal_is_along_path);

  const Path siding = path_from({3, 300, Direction::reverse}, 300, 0);
  ASSERT_EQ(siding.landmarks().size(), 1U);
  EXPECT_EQ(siding.landmarks()[0].kind, LandmarkKind::portal_out);
}

/// Of one edge, closed.
std::shared_ptr<const Map> ring(double length_m) {
  auto map = std::make_shared<Map>();
  map->edges = {{1, "ring", 1, 1, "", Alignment::chained({}, {{length_m, 0.01, 0.01}})}};
  map->nodes = {{1, NodeKind::joint, "", 0, 0}};
  map->connections = {{1, 1, 1, false}};
  return map;
}

TEST(Path, EndsOnARing) {
  const double length = 2 * core::kPi * 100;
  const Path path = core::value_or_throw(Path::follow(ring(length), {1, 10, Direction::forward}, 2000, 2000));
  EXPECT_NEAR(path.end_m(), 2000, 1e-9);
  EXPECT_NEAR(path.begin_m(), -2000, 1e-9);
  EXPECT_NEAR(path.position_at(length).offset_m, 10, 1e-9);
  EXPECT_EQ(path.position_at(1500).direction, Direction::forward);
  EXPECT_NEAR(*path.distance_of(1, 5), -5, 1e-9);
  EXPECT_NEAR(*path.distance_of({1, 5, Direction::forward}, 1.9 * length), 2 * length - 5, 1e-9);
  EXPECT_FALSE(path.distance_of({1, 5, Direction::reverse}, 0));
}

TEST(Path, OfATrainThatRunsForWeeksStaysShort) {
  const double length_m = 2 * core::kPi / 0.01;
  const auto map = ring(length_m);
  const Ways ways(*map);
  Path path = core::value_or_throw(Path::follow(map, {1, 10, Direction::forward}, 2000, 2000));
  constexpr double kRunM = 600'000;
  for (double here_m = 0; here_m < kRunM; here_m += 30'000)
    path = followed_on(path, ways, here_m, 60'000, 2000).value();
  EXPECT_LT(path.end_m() - path.begin_m(), 300'000);
  const double place_m = std::round(kRunM / length_m) * length_m;
  EXPECT_NEAR(*path.distance_of({1, 10, Direction::forward}, kRunM), place_m, 1e-3);
  EXPECT_NEAR(path.position_at(place_m + 100).offset_m, 110, 1e-3);
}

TEST(Path, IsFollowedOnWithItsDistances) {
  const auto map = shared_small_map();
  const Ways ways(*map);
  const Path siding = core::value_or_throw(Path::follow(map, {3, 300, Direction::forward}, 100, 100));
  const Path longer = followed_on(siding, ways, 50, 5000, 5000).value();
  EXPECT_NEAR(longer.distance_of(3, 300).value(), 0, 1e-9);
  EXPECT_NEAR(longer.distance_of({1, 900, Direction::reverse}, 0).value(), 300, 1e-9);
  EXPECT_FALSE(longer.distance_of({1, 900, Direction::forward}, 0));
  EXPECT_NEAR(longer.begin_m(), -300, 1e-9);
  EXPECT_NEAR(longer.end_m(), 1200, 1e-9);
  EXPECT_EQ(longer.position_at(60).offset_m, siding.position_at(60).offset_m);
  EXPECT_FALSE(followed_on(longer, ways, 0, 9000, 9000)) << "the track ends";
}

TEST(SameMap, APlaceThatLiesElsewhereIsOfAnotherMap) {
  const auto map = shared_small_map();
  PlanPose pose = cab_pose(*map, {2, 300, Direction::forward});
  const PlanPose not_told{0, 0, pose.heading_rad};
  const PlanPose none{NAN, NAN, NAN};
  EXPECT_TRUE(lies_there(*map, {2, 300, Direction::forward}, none));
  EXPECT_TRUE(lies_there(*map, {2, 300, Direction::forward}, not_told));
  EXPECT_FALSE(lies_there(*map, {2, 310, Direction::forward}, pose));
  EXPECT_FALSE(lies_there(*map, {1, 300, Direction::forward}, pose));
  EXPECT_FALSE(lies_there(*map, {99, 300, Direction::forward}, none));
  pose.easting_m += 0.1;
  EXPECT_TRUE(lies_there(*map, {2, 300, Direction::forward}, pose));
}

// In the middle of its edge one that is numbered from the other end lies where it should.
TEST(SameMap, ATrackThatIsDrawnTheOtherWayRoundIsOfAnotherMap) {
  const auto map = shared_small_map();
  PlanPose pose = cab_pose(*map, {2, 300, Direction::reverse});
  pose.heading_rad += 2 * core::kPi;
  EXPECT_TRUE(lies_there(*map, {2, 300, Direction::reverse}, pose));
  EXPECT_FALSE(lies_there(*map, {2, 300, Direction::forward}, pose));
  EXPECT_TRUE(lies_there(*map, {2, 300, Direction::unknown}, pose)) << "whose direction is not told";
  pose.heading_rad = NAN;
  EXPECT_TRUE(lies_there(*map, {2, 300, Direction::forward}, pose));
}

TEST(Path, GoesOnWithItsDistancesOnAnotherTrackBehindASwitch) {
  const auto map = shared_small_map();
  const Ways ways(*map);
  EXPECT_EQ(ways.after({map->edge(1), true}).size(), 2U);
  EXPECT_EQ(ways.after({map->edge(1), true}).front().edge->id, 2U);
  EXPECT_EQ(ways.before({map->edge(2), true}).front().edge->id, 1U);
  const Path straight = core::value_or_throw(Path::follow(map, {1, 400, Direction::forward}, 1200, 300));
  const Path other = rerouted(straight, ways, {3, 450, Direction::reverse}, 660, 1000, 1000).value().path;
  EXPECT_NEAR(other.distance_of(1, 100).value(), -300, 1e-9);
  EXPECT_NEAR(other.distance_of(3, 450).value(), 650, 1e-9);
  EXPECT_FALSE(other.distance_of(2, 10));
  EXPECT_NEAR(other.end_m(), 1100, 1e-9);
  // The other way round: from the siding's side the train was really on the main line; distances meet at the switch.
  const Path reverse = core::value_or_throw(Path::follow(map, {2, 300, Direction::reverse}, 1200, 300));
  const Path from_siding = rerouted(reverse, ways, {3, 300, Direction::forward}, 100, 1000, 300).value().path;
  EXPECT_NEAR(from_siding.distance_of(3, 300).value(), 100, 1e-9);
  EXPECT_NEAR(from_siding.distance_of(1, 900).value(), 400, 1e-9);
  EXPECT_FALSE(rerouted(straight, ways, {3, 450, Direction::forward}, 77, 10, 10)) << "nothing joins them";
}

TEST(Path, IsJoinedToAnotherTrackByTheWayOfTheLengthThatWasRun) {
  auto made = std::make_shared<Map>();
  const auto straight = [](double from_m, double length_m) {
    return Alignment::chained({0, from_m, 0}, {{length_m, 0, 0}});
  };
  made->edges = {{1, "stem", 1, 2, "", straight(0, 500)},     {2, "main", 2, 3, "", straight(500, 2000)},
                 {3, "by two", 2, 4, "", straight(500, 100)}, {4, "of them", 4, 5, "", straight(600, 100)},
                 {5, "by one", 2, 5, "", straight(500, 240)}, {6, "there", 5, 6, "", straight(700, 900)}};
  made->connections = {{2, 1, 2, false}, {2, 1, 3, true},  {2, 1, 5, true},
                       {4, 3, 4, false}, {5, 4, 6, false}, {5, 5, 6, true}};
  const std::shared_ptr<const Map> map = made;
  const Ways ways(*map);
  const Path main = core::value_or_throw(Path::follow(map, {1, 0, Direction::forward}, 2000, 0));
  for (const double run_m : {760.0, 800.0}) {
    const auto found = rerouted(main, ways, {6, 60, Direction::forward}, run_m, 1000, 1000);
    ASSERT_TRUE(found);
    EXPECT_NEAR(found->path.distance_of(6, 60).value(), run_m, 1e-9);
    ASSERT_EQ(found->otherwise_m.size(), 1U);
    EXPECT_NEAR(found->otherwise_m.front(), run_m == 760 ? 800 : 760, 1e-9);
  }
}

// Directions of a drawing say nothing: a leg that leaves it sharply is one.
TEST(Path, DividesWhereTheWaysDo) {
  for (const bool drawn : {false, true}) {
    auto map = std::make_shared<Map>();
    map->edges = {{1, "stem", 1, 2, "", Alignment::chained({0, 0, 0}, {{500, 0, 0}})},
                  {2, "on", 2, 3, "", Alignment::chained({0, 500, 0}, {{500, 0, 0}})},
                  {3, "leg", 2, 4, "", Alignment::chained({0, 500, 2.2}, {{500, 0, 0}})}};
    for (auto& edge : map->edges) edge.is_drawn = drawn;
    map->connections = {{2, 1, 2, false}, {2, 1, 3, true}};
    const auto path = core::value_or_throw(Path::follow(map, {1, 400, Direction::forward}, 400, 300));
    EXPECT_EQ(Ways(*map).after({map->edge(1), true}).size(), drawn ? 2U : 1U);
    EXPECT_EQ(path.switches().size(), drawn ? 1U : 0U);
  }
}

TEST(Path, SaysWhereItCannotStart) {
  EXPECT_FALSE(Path::follow(shared_small_map(), {9, 0, Direction::forward}, 1, 1).ok());
  EXPECT_FALSE(Path::follow(shared_small_map(), {1, 1001, Direction::forward}, 1, 1).ok());
  EXPECT_FALSE(Path::follow(shared_small_map(), {1, std::nan(""), Direction::forward}, 1, 1).ok());
}

/// Straights of 100, 5 and 100 m with corners between them.
Map cornered(double first_rad, double second_rad) {
  Map map;
  PlanPose pose{0, 0, 0};
  uint32_t id = 0;
  for (const auto& [length_m, corner_rad] : {std::pair(100.0, first_rad), {5.0, second_rad}, {100.0, 0.0}}) {
    const Alignment straight = Alignment::chained(pose, {{length_m, 0, 0}});
    ++id;
    map.edges.push_back({id, "e", id, id + 1, "", straight});
    pose = straight.at(length_m).pose;
    pose.heading_rad -= corner_rad;  // headings grow to the right
  }
  return map;
}
double turned_rad(const Route& route) {
  double sum = 0;
  for (double m = 0.005; m < 205; m += 0.01) sum += 0.01 * route.curvature_at(m);
  return sum;
}

TEST(Route, TurnsByItsCornersHoweverItIsBuiltAndRun) {
  for (const auto& [first, second] : {std::pair(0.11, 0.0), {0.11, -0.05}, {-0.08, -0.08}}) {
    const Map map = cornered(first, second);
    const auto run = [&](size_t i, bool forward) { return track::Run{&map.edges[i], forward}; };
    Route ahead(run(0, true), 0, 0);
    ahead.push_ahead(run(1, true));
    ahead.push_ahead(run(2, true));
    EXPECT_NEAR(turned_rad(ahead), first + second, 2e-4);
    Route behind(run(2, true), 0, 105);
    behind.push_behind(run(1, true));
    behind.push_behind(run(0, true));
    EXPECT_NEAR(turned_rad(behind), first + second, 2e-4);
    behind.drop_behind();
    behind.push_behind(run(0, true));
    EXPECT_NEAR(turned_rad(behind), first + second, 2e-4);
    Route back(run(2, false), 100, 0);
    back.push_ahead(run(1, false));
    back.push_ahead(run(0, false));
    EXPECT_NEAR(turned_rad(back), -first - second, 2e-4) << "the other way it turns to the other side";
  }
}

TEST(Ways, TurnAnyhowWhereTheTracksAreOnlyDrawn) {
  for (const bool drawn : {false, true}) {
    Map map = cornered(2.5, 0);
    map.connections = {{2, 1, 2, false}};
    map.edges[1].is_drawn = drawn;
    const Ways ways(map);
    EXPECT_EQ(ways.after({&map.edges[0], true}).size(), drawn ? 1U : 0U);
  }
}

TEST(Route, HasNoCornersWhereItIsOnlyDrawnOrNoTurnoutIsSo) {
  for (const bool drawn : {false, true}) {
    Map map = cornered(drawn ? 0.11 : 0.6, 0);
    map.edges[1].is_drawn = drawn;
    Route route({&map.edges[0], true}, 0, 0);
    route.push_ahead({&map.edges[1], true});
    EXPECT_EQ(route.curvature_at(100), 0);
  }
}

}  // namespace
}  // namespace railfix::track
