#include "map_matcher/track_choice/track_chooser.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/LU>
#include <set>

#include "support/switch_passage.hpp"
#include "unit/map_matcher/fork_map.hpp"

namespace railfix::map_matcher {
namespace {

using testing::Manoeuvre;
using testing::PassagePlan;
using testing::SwitchPassage;

TEST(TrackChooser, OverRandomSwitchesNothingDeclaredIsWrong) {
  core::Random random(77);
  int open = 0;
  int facing = 0;
  int late = 0;
  constexpr uint64_t kPassages = 60;
  for (uint64_t i = 0; i < kPassages; ++i) {
    const PassagePlan plan = testing::random_passage(random);
    const auto result = SwitchPassage(plan, 1000 + i).run();
    EXPECT_FALSE(result.wrong) << plan.text();
    open += result.known_at_end ? 0 : 1;
    if (!plan.facing) continue;
    ++facing;
    // A camera sees the rails ahead of the foot, and the place on the map is vague.
    if (!plan.camera || !plan.views) {
      EXPECT_GT(result.open_steps, 0) << "declared before anything could be known: " << plan.text();
    }
    late += result.behind_frog_m > 30 ? 1 : 0;
  }
  EXPECT_LE(open, 1);
  EXPECT_LE(late, facing / 10);
}

// Fast over the flattest turnouts, which turn the train as little as its body sways.
TEST(TrackChooser, ABodyThatSwaysTwiceAsMuchMakesNothingThatIsDeclaredWrong) {
  for (uint64_t seed = 1; seed <= 120; ++seed) {
    PassagePlan plan;
    plan.diverging = seed % 2 == 0;
    plan.radius_m = 1200;
    plan.speed_mps = 28;
    plan.sway_rad = 0.003;
    plan.views = false;
    const auto result = SwitchPassage(plan, seed).run();
    EXPECT_FALSE(result.wrong) << seed << ", " << result.wrong_at_m << " m behind the points";
    EXPECT_TRUE(result.known_at_end) << seed;
  }
}

TEST(TrackChooser, ASlowTrainKnowsTheLegOfAFlatTurnoutInTime) {
  int late = 0;
  for (uint64_t seed = 1; seed <= 100; ++seed) {
    PassagePlan plan;
    plan.diverging = seed % 2 == 0;
    plan.radius_m = 1200;
    plan.speed_mps = 4;
    plan.views = false;
    plan.frog_seen = seed % 4 < 2;
    const auto result = SwitchPassage(plan, seed).run();
    EXPECT_FALSE(result.wrong) << seed << ", " << result.wrong_at_m << " m behind the points";
    EXPECT_TRUE(result.known_at_end) << seed;
    late += result.behind_frog_m > 30 ? 1 : 0;
  }
  EXPECT_LE(late, 4);
}

TEST(TrackChooser, AThrownSwitchIsFollowedAfterGoingBack) {
  for (uint64_t seed = 1; seed <= 12; ++seed) {
    PassagePlan plan;
    plan.diverging = seed % 2 == 0;
    plan.manoeuvre = Manoeuvre::back_and_forth;
    plan.speed_mps = 8;
    const auto result = SwitchPassage(plan, seed).run();
    EXPECT_FALSE(result.wrong) << seed;
    EXPECT_TRUE(result.known_at_end) << seed;
  }
}

// The map has the points up to some metres behind where they are, so that the foot seems to be past them still.
TEST(TrackChooser, AThrownSwitchIsFollowedAfterGoingBackNoFurtherThanItsPoints) {
  for (uint64_t seed = 1; seed <= 60; ++seed) {
    PassagePlan plan;
    plan.diverging = seed % 2 == 0;
    plan.manoeuvre = Manoeuvre::just_clear;
    plan.radius_m = 215;
    plan.speed_mps = 5;
    plan.sigma_m = 0.1;
    plan.switch_sigma_m = 1.5;
    plan.camera = seed % 4 < 2;
    const auto result = SwitchPassage(plan, seed).run();
    EXPECT_FALSE(result.wrong) << seed << ", " << result.wrong_at_m << " m behind the points";
    EXPECT_TRUE(result.known_at_end) << seed;
  }
}

TEST(TrackChooser, WithoutAnyTurningMeasuredItSaysNotYetKnown) {
  const auto map = fork();
  TrackChooser chooser({}, map, std::make_shared<const track::Ways>(*map));
  for (double place_m = 400; place_m < 700; place_m += 1) {
    const bool behind = place_m > 500;
    chooser.follow({{behind ? 2U : 1U, behind ? place_m - 500 : place_m, track::Direction::forward}, 3, 3, 0.5});
    chooser.move_blind(1);
    const auto choice = chooser.choice();
    ASSERT_TRUE(choice);
    EXPECT_EQ(choice->known, place_m < 499) << place_m;
    if (!choice->known) {
      ASSERT_EQ(choice->options.size(), 2U);
      EXPECT_NEAR(choice->options[0].probability, 0.5, 1e-6);
    }
  }
}

// The way behind the begin is not known, although the train has not been seen to turn round yet.
TEST(TrackChooser, WhoBeginsToBackOverPointsDoesNotKnowTheLeg) {
  const auto map = fork();
  for (const double step_m : {0.05, 0.5, 10.0, 30.0}) {
    for (const bool blind : {false, true}) {
      TrackChooser chooser({}, map, std::make_shared<const track::Ways>(*map));
      chooser.follow({{1, 499.78, track::Direction::reverse}, 0.1, 0.1, 0.05});
      for (double way_m = step_m; way_m <= std::max(step_m, 1.0); way_m += step_m) {
        if (blind) {
          chooser.move_blind(-step_m);
        } else {
          chooser.move({.way_m = -step_m, .sigma_rad = 0.1, .duration_s = step_m});
        }
        const auto choice = chooser.choice();
        EXPECT_EQ(choice->known, way_m < 0.22) << way_m;
        EXPECT_EQ(choice->options.size(), choice->known ? 1U : 2U) << way_m;
      }
    }
  }
}

TEST(TrackChooser, ATrainThatIsMovedBackOverPointsByFusionIsOnNoLegThatWasGuessed) {
  const auto map = fork();
  for (const double back_m : {0.5, 20.0}) {
    TrackChooser chooser({}, map, std::make_shared<const track::Ways>(*map));
    chooser.follow({{1, 499.78, track::Direction::reverse}, 0.1, 0.1, 0.05});
    EXPECT_TRUE(chooser.choice()->known);
    chooser.follow({{2, back_m, track::Direction::reverse}, 0.1, 0.1, 0.05});
    EXPECT_FALSE(chooser.choice()->known) << back_m;
    chooser.move({.way_m = back_m + 1, .sigma_rad = 0.1, .duration_s = 1});
    chooser.follow({{1, 499, track::Direction::reverse}, 0.1, 0.1, 0.05});
    EXPECT_TRUE(chooser.choice()->known) << "before the points again";
  }
}

// Two ways that meet know the bias otherwise: together they may know less than at first.
TEST(TurnCells, JoinedOnesKnowSomethingThatCanBe) {
  TurnCell cell{{TurnFit{0, {{3, 0.002}, Eigen::Vector2d(0.01, 1e-7).asDiagonal()}}}};
  const TurnCell other{{TurnFit{0, {{-3, -0.002}, Eigen::Vector2d(0.01, 1e-7).asDiagonal()}}}};
  join_cells(cell, 0, other, 0);
  std::vector<TurnCell> cells(10, cell);
  const auto map = fork();
  const track::Route route({map->edge(1), true}, 100, 0);
  const BinTurn bin{
      .way_m = 2, .turn_rad = 1e-4, .variance = 1e-8, .bias_rad = 2e-4, .bias_walk = 1e-6, .duration_s = 0.1};
  for (int i = 0; i < 30; ++i) {
    weigh_turn(cells, 2.0 * i, route, bin, {});
    for (const TurnCell& of : cells) {
      EXPECT_TRUE(std::isfinite(of.log_weight()));
      ASSERT_GT(of.fits[0].errors.covariance.determinant(), 0) << i;
      ASSERT_GT(of.fits[0].errors.covariance(0, 0), 0) << i;
    }
  }
}

// On a straight track the gyro has another error all at once: that it failed soon fits better, and ends the sums of
// weights no less than one. A place without it stays without it where the two are joined.
TEST(TurnCells, AJumpOfTheBiasIsFollowedBesideWhatWasBelieved) {
  const auto map = fork();
  const track::Route route({map->edge(1), true}, 100, 0);
  BinTurn bin{.way_m = 2,
              .turn_rad = 0,
              .variance = 1e-7,
              .bias_rad = 1e-4,
              .bias_walk = 1e-6,
              .duration_s = 0.1,
              .jump_rad = 0.05 * 0.1};
  std::vector<TurnCell> cells(10);
  for (int i = 0; i < 20; ++i) weigh_turn(cells, i, route, bin, {});
  const auto jumped = [&](size_t i) { return cells[i].fits[1].log_weight - cells[i].fits[0].log_weight; };
  for (TurnCell& cell : cells) begin_jump(cell, 1, bin, 1e-4);
  EXPECT_NEAR(jumped(5), std::log(1e-4), 1e-9);
  for (int i = 0; i < 20; ++i) weigh_turn(cells, 20 + i, route, bin, {});
  EXPECT_LT(jumped(5), std::log(1e-4)) << "it did not jump";
  for (TurnCell& cell : cells) begin_jump(cell, 1, bin, 1e-4);
  bin.turn_rad = 0.03 * bin.duration_s;
  for (int i = 0; i < 40; ++i) {
    weigh_turn(cells, 40 + i, route, bin, {});
    spread(cells, bin.way_m);
  }
  EXPECT_GT(jumped(5), 5);
  EXPECT_NEAR(cells[5].fits[1].errors.mean[TurnErrors::bias] * bin.bias_rad, bin.turn_rad, 5e-4);
  TurnCell joined = cells[5];
  join_cells(joined, 0, TurnCell{}, -1000);
  EXPECT_NEAR(joined.log_weight(), cells[5].log_weight(), 1e-6);
  joined.begin_sensor();
  EXPECT_NEAR(joined.fits[0].log_weight, cells[5].log_weight(), 1e-6);
  EXPECT_FALSE(std::isfinite(joined.fits[1].log_weight));
}

// As a map_matcher that was away while the train ran over the switch.
TEST(TrackChooser, WhoBeginsBehindASwitchThatNobodyWatchedDoesNotKnowTheTrack) {
  const auto map = fork();
  const auto ways = std::make_shared<const track::Ways>(*map);
  const auto forward = track::Direction::forward;
  TrackChooser sure({}, map, ways);
  sure.follow({{2, 100, forward}, 3, 3, 0.5, 0.9995});
  EXPECT_TRUE(sure.choice()->known) << "fusion knows why";
  TrackChooser less_sure({}, map, ways);
  less_sure.follow({{2, 100, forward}, 3, 3, 0.5, 0.99});
  EXPECT_FALSE(less_sure.choice()->known) << "nobody has declared it";
  EXPECT_NEAR(less_sure.choice()->options.front().probability, 0.99, 1e-6);
  TrackChooser at_points({}, map, ways);
  at_points.follow({{2, 2, forward}, 9, 9, 0.5, 1});
  EXPECT_NEAR(at_points.choice()->options.front().probability, 0.5, 1e-6) << "it may stand in front of them";

  TrackChooser chooser({}, map, ways);
  chooser.follow({{2, 15, forward}, 3, 3, 0.5, 0.5});
  const auto begin = chooser.choice();
  EXPECT_FALSE(begin->known);
  ASSERT_EQ(begin->options.size(), 2U);
  EXPECT_NEAR(begin->options[0].probability, 0.5, 1e-6);
  EXPECT_NEAR(begin->options[0].place.offset_m, 15, 1e-6);
  EXPECT_NEAR(begin->options[1].place.offset_m, 15, 1e-6);
  // The train turns left, until the body has left the curve.
  for (double place_m = 15; place_m < 75; place_m += 1) {
    chooser.move({1, place_m < 50 ? 0.003 : 0.0, 1e-4});
    chooser.follow({{2, place_m + 1, forward}, 3, 3, 0.5, 0.5});
  }
  EXPECT_EQ(chooser.choice()->options.front().place.edge, 3U);
  EXPECT_TRUE(chooser.choice()->known);
}

// The doubt may be of a switch further back than the last one.
TEST(TrackChooser, WhoBeginsInDoubtLooksAtEverySwitchBehind) {
  auto made = std::make_shared<track::Map>(*fork());
  made->edges.push_back({4, "of the second", 3, 5, "", track::Alignment::chained({0, 1000, 0}, {{800, 0, 0}})});
  made->edges.push_back(
      {5, "left of it", 3, 6, "", track::Alignment::chained({0, 1000, 0}, {{40, 0.003, 0.003}, {760, 0, 0}})});
  made->connections.push_back({3, 2, 4, false});
  made->connections.push_back({3, 2, 5, true});
  const std::shared_ptr<const track::Map> map = made;
  TrackChooser chooser({}, map, std::make_shared<const track::Ways>(*map));
  const auto window = [](double place_m) {
    return TrackWindow{{4, place_m, track::Direction::forward}, 3, 3, 0.5, 0.5};
  };
  chooser.follow(window(12));
  for (double place_m = 12; place_m < 140; place_m += 1) {
    chooser.move({1, 0, 1e-4});  // straight on: not over the second one's leg
    chooser.follow(window(place_m + 1));
  }
  const auto choice = chooser.choice();
  EXPECT_FALSE(choice->known) << "the left leg of the first one is as straight there";
  EXPECT_LT(choice->options.front().probability, 0.7);
}

// The speed of a train that stands has the sign of its noise.
TEST(TrackChooser, WhoBeginsInDoubtAtAHaltLooksAtTheSwitchBehindAndIfThereIsNoneAtTheOneInFront) {
  auto made = std::make_shared<track::Map>(*fork());
  made->edges.push_back({4, "beyond", 3, 5, "", track::Alignment::chained({0, 1000, 0}, {{800, 0, 0}})});
  made->edges.push_back({5, "joins it", 6, 3, "", track::Alignment::chained({0, 1000, 0}, {{800, 0, 0}})});
  made->connections.push_back({3, 2, 4, false});
  made->connections.push_back({3, 5, 4, true});
  const std::shared_ptr<const track::Map> map = made;
  const auto options_at = [&](uint32_t edge, double place_m) {
    TrackChooser chooser({}, map, std::make_shared<const track::Ways>(*map));
    chooser.follow({.place = {edge, place_m, track::Direction::forward},
                    .over_m = 3,
                    .under_m = 3,
                    .sigma_m = 0.5,
                    .probability = 0.5,
                    .stands = true});
    std::set<uint32_t> edges;
    const auto choice = chooser.choice();
    EXPECT_FALSE(choice->known);
    for (const auto& option : choice->options) edges.insert(option.place.edge);
    return edges;
  };
  EXPECT_THAT(options_at(2, 5), ::testing::UnorderedElementsAre(2, 3)) << "near the points behind";
  EXPECT_THAT(options_at(2, 400), ::testing::UnorderedElementsAre(2, 3, 5)) << "either may be why";
}

/// Fusion has declared the track, and is 3 m sure of the place.
void follow(TrackChooser& chooser, uint32_t edge, double place_m) {
  chooser.follow({{edge, place_m, track::Direction::forward}, 3, 3, 0.5, 1});
}

// Fusion follows the straight leg, which ends, and stands at its end; the train may have gone on over the other one.
TEST(TrackChooser, ATrackThatHasEndedHoldsNobodyBackAndIsNotDeclared) {
  auto made = std::make_shared<track::Map>(*fork());
  made->edges[1].alignment = track::Alignment::chained({0, 500, 0}, {{100, 0, 0}});
  const std::shared_ptr<const track::Map> map = made;
  TrackChooser chooser({}, map, std::make_shared<const track::Ways>(*map));
  follow(chooser, 1, 400);
  for (double way_m = 402; way_m <= 900; way_m += 2) {
    chooser.move_blind(2);
    way_m <= 500 ? follow(chooser, 1, way_m) : follow(chooser, 2, std::min(way_m - 500, 100.0));
  }
  const auto choice = chooser.choice();
  EXPECT_FALSE(choice->known);
  ASSERT_EQ(choice->options.size(), 1U);
  EXPECT_EQ(choice->options.front().place.edge, 3U);
  EXPECT_NEAR(choice->options.front().place.offset_m, 400, 0.1);
  EXPECT_NEAR(choice->options.front().probability, 0.5, 0.01);
}

TEST(TrackChooser, OverWhichOfTwoLengthsItCameIsSaidBeyondTheJoint) {
  auto made = std::make_shared<track::Map>(*fork());
  made->edges[1].to_node = made->edges[2].to_node = 5;
  made->edges[2].alignment = track::Alignment::chained({0, 500, 0}, {{560, 0, 0}});
  made->edges.push_back({4, "on", 5, 6, "", track::Alignment::chained({0, 1000, 0}, {{1000, 0, 0}})});
  made->connections.push_back({5, 2, 4, false});
  made->connections.push_back({5, 3, 4, true});
  made->landmarks.clear();
  const std::shared_ptr<const track::Map> map = made;
  TrackChooser chooser({}, map, std::make_shared<const track::Ways>(*map));
  follow(chooser, 1, 400);
  for (double way_m = 402; way_m <= 1200; way_m += 2) {
    chooser.move_blind(2);
    way_m <= 500    ? follow(chooser, 1, way_m)
    : way_m <= 1000 ? follow(chooser, 2, way_m - 500)
                    : follow(chooser, 4, way_m - 1000);
  }
  const auto choice = chooser.choice();
  EXPECT_TRUE(choice->known);
  EXPECT_EQ(choice->options.front().place.edge, 4U);
  ASSERT_EQ(choice->elsewhere.size(), 1U);
  EXPECT_EQ(choice->elsewhere.front().place.edge, 4U);
  EXPECT_NEAR(choice->elsewhere.front().probability, 0.5, 0.01);
  EXPECT_NEAR(std::abs(choice->elsewhere.front().place.offset_m - choice->options.front().place.offset_m), 60, 0.1);
}

TEST(TrackChooser, WaysThatMeetAgainNeedNotBeToldApart) {
  auto made = std::make_shared<track::Map>(*fork());
  made->edges.push_back({4, "together", 5, 6, "", track::Alignment::chained({0, 1000, 0}, {{900, 0, 0}})});
  made->edges[1].to_node = made->edges[2].to_node = 5;
  made->connections.insert(made->connections.end(), {{5, 2, 4, false}, {5, 3, 4, true}});
  const std::shared_ptr<const track::Map> map = made;
  TrackChooser chooser({}, map, std::make_shared<const track::Ways>(*map));
  chooser.follow({{2, 300, track::Direction::forward}, 3, 3, 0.5, 0.5});
  EXPECT_FALSE(chooser.choice()->known);
  for (double place_m = 300; place_m < 650; place_m += 1) chooser.move({1, 0, 1e-4});
  EXPECT_EQ(chooser.choice()->options.front().place.edge, 4U);
  EXPECT_TRUE(chooser.choice()->known);
}

TEST(TrackChooser, ADoubtThatCannotBeLookedIntoStays) {
  auto made = std::make_shared<track::Map>();
  made->edges.push_back({1, "alone", 1, 2, "", track::Alignment::chained({0, 0, 0}, {{5000, 0, 0}})});
  const std::shared_ptr<const track::Map> map = made;
  TrackChooser chooser({}, map, std::make_shared<const track::Ways>(*map));
  chooser.follow({{1, 4000, track::Direction::forward}, 3, 3, 0.5, 0.5});
  EXPECT_FALSE(chooser.choice()->known);
  EXPECT_NEAR(chooser.choice()->options.front().probability, 0.5, 1e-9);
}

TEST(TrackChooser, TheSideOfTheFrogCounts) {
  auto made = std::make_shared<track::Map>(*fork());
  made->landmarks = {{1, track::LandmarkKind::frog, 2, 30, 0.72, 0.1, ""},
                     {2, track::LandmarkKind::frog, 3, 30, -0.72, 0.1, ""}};
  const std::shared_ptr<const track::Map> map = made;
  TrackChooser chooser({}, map, std::make_shared<const track::Ways>(*map));
  chooser.follow({{1, 490, track::Direction::forward}, 3, 3, 0.5});
  for (int i = 0; i < 32; ++i) chooser.move_blind(1);
  chooser.sight({0, track::LandmarkKind::frog, 8, -0.72, 0.2, 0.95});
  const auto choice = chooser.choice();
  ASSERT_TRUE(choice);
  EXPECT_EQ(choice->options.front().place.edge, 3U);
  EXPECT_GT(choice->options.front().probability, 0.8);
  EXPECT_FALSE(choice->known);
}

// Where the legs share no rails a balise below the train is its own; beside the points a detector may still be astray.
TEST(TrackChooser, ABaliseBelowTheTrainTellsTheLegWhereTheyAreApart) {
  auto made = std::make_shared<track::Map>(*fork());
  made->landmarks = {{1, track::LandmarkKind::balise, 2, 25, 0, 0.1, ""},
                     {2, track::LandmarkKind::balise, 2, 250, 0, 0.1, ""},
                     {3, track::LandmarkKind::balise, 2, 253, 0, 0.1, ""},
                     {4, track::LandmarkKind::balise, 2, 400, 0, 0.1, ""}};
  const std::shared_ptr<const track::Map> map = made;
  TrackChooser chooser({}, map, std::make_shared<const track::Ways>(*map));
  chooser.follow({{1, 490, track::Direction::forward}, 3, 3, 0.5});
  double at_m = 490;
  const auto sight_at = [&](double leg_m) {
    for (; at_m < 500 + leg_m - 8; at_m += 1) chooser.move_blind(1);
    chooser.sight({0, track::LandmarkKind::balise, 8, 0, 0.2, 0.95});
    return *chooser.choice();
  };
  EXPECT_LT(sight_at(25).options.front().probability, 0.95) << "2 m apart";
  sight_at(250);
  const auto group = sight_at(253);
  EXPECT_EQ(group.options.front().place.edge, 2U);
  EXPECT_GT(group.options.front().probability, 0.97);
  EXPECT_FALSE(group.known) << "the map may have one group on the wrong track";
  EXPECT_TRUE(sight_at(400).known);
}

// A detector that follows the other leg shows it in every picture: many of them say little more than one.
TEST(TrackChooser, PicturesAloneNeverDeclareATrack) {
  const auto map = fork();
  TrackChooser chooser({}, map, std::make_shared<const track::Ways>(*map));
  chooser.follow({{1, 480, track::Direction::forward}, 2, 2, 0.3});
  for (double place_m = 480; place_m < 530; place_m += 1) {
    chooser.move_blind(1);
    if (place_m > 505) chooser.see(0.003, 2e-4);
  }
  const auto choice = chooser.choice();
  ASSERT_TRUE(choice);
  EXPECT_EQ(choice->options.front().place.edge, 3U);
  EXPECT_GT(choice->options.front().probability, 0.7);
  EXPECT_FALSE(choice->known);
}

// As drawn from the middle of its turnout: the leg has no curve on the map.
TEST(TrackChooser, ALegThatIsDrawnWithACornerIsToldByTheCorner) {
  constexpr double kCornerRad = 0.11;  // 1 in 9
  auto map = std::make_shared<track::Map>(*fork());
  map->edges[2].alignment = track::Alignment::chained({0, 500, -kCornerRad}, {{500, 0, 0}});
  const auto ways = std::make_shared<const track::Ways>(*map);
  for (const bool left : {false, true}) {
    TrackChooser chooser({}, map, ways);
    const uint32_t edge = left ? 3 : 2;
    for (double place_m = 400; place_m < 640; place_m += 0.5) {
      const bool behind = place_m > 500;
      chooser.follow({{behind ? edge : 1U, behind ? place_m - 500 : place_m, track::Direction::forward}, 3, 3, 0.5});
      const bool turns = left && std::abs(place_m - 500) < 10.5;  // a radius of 190 m about the corner
      chooser.move({0.5, turns ? kCornerRad / 42 : 0, 1e-4});
    }
    const auto choice = chooser.choice();
    EXPECT_EQ(choice->options.front().place.edge, edge);
    EXPECT_TRUE(choice->known) << edge;
  }
}

}  // namespace
}  // namespace railfix::map_matcher
