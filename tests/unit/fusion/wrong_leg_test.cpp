// A leg that is declared wrongly: what speaks against it, and the way back.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "straight_run.hpp"
#include "support/train/verdict.hpp"

namespace railfix::fusion {
namespace {

using testing::HasSubstr;

constexpr uint32_t kStraight = 2;
constexpr uint32_t kLeft = 3;

/// A train that comes to points at 1000 m; the left leg is an arc of 1000 m radius.
class WrongLeg : public testing::Test {
 protected:
  static Fusion at_900_m() { return starting_at({1, 900, track::Direction::forward}); }
  static Fusion starting_at(const track::EdgePosition& start) {
    auto map = std::make_shared<track::Map>();
    map->edges.push_back({1, "stem", 1, 2, "", track::Alignment::chained({0, 0, 0}, {{1000, 0, 0}})});
    map->edges.push_back({2, "straight", 2, 3, "", track::Alignment::chained({0, 1000, 0}, {{9000, 0, 0}})});
    map->edges.push_back({3, "left", 2, 4, "", track::Alignment::chained({0, 1000, 0}, {{9000, 0.001, 0.001}})});
    map->connections = {{2, 1, 2, false}, {2, 1, 3, true}};
    return core::value_or_throw(Fusion::create({}, map, start));
  }
  void declare(double t_s, uint32_t edge, double offset_m) {
    fusion_.add(FixInput{at(t_s), edge, offset_m, INFINITY, 0.9995, 0, FixKind::track, track::Direction::forward, {}});
  }
  void landmark(double t_s, uint32_t edge, double offset_m) {
    fusion_.add(
        FixInput{at(t_s), edge, offset_m, 0.1, 0.995, ++seen_, FixKind::landmark, track::Direction::forward, {}});
  }
  /// 20 m/s; the gyro feels this curvature.
  TrainEstimate go(double from_s, double to_s, double curvature_per_m) {
    std::optional<TrainEstimate> last;
    for (int i = 1; from_s + i * 0.02 <= to_s + 1e-9; ++i) {
      const double t_s = from_s + i * 0.02;
      const double noise_rps = i % 2 == 0 ? 1e-4 : -1e-4;
      fusion_.add(ImuInput{at(t_s), 0, 20 * curvature_per_m + noise_rps});
      if (auto state = fusion_.add(step_at(t_s, 20))) last = state;
    }
    return last.value_or(TrainEstimate{});
  }

  Fusion fusion_ = at_900_m();
  uint32_t seen_ = 0;
};

TEST_F(WrongLeg, WhoIsToldToStartJustBehindPointsMayStandInFrontOfThem) {
  const auto probability = [](uint32_t edge, double offset_m) {
    auto fusion = starting_at({edge, offset_m, track::Direction::forward});
    return run(fusion, 0, 0.1, 1).track_probability;
  };
  EXPECT_EQ(probability(kStraight, 3), 0.5);
  EXPECT_EQ(probability(kLeft, 3), 0.5);
  EXPECT_EQ(probability(kStraight, 20), 1);
  EXPECT_EQ(probability(1, 999), 1) << "the points are still to come";
}

TEST_F(WrongLeg, ALandmarkOnTheOtherLegDoubtsItHoweverOftenItIsDeclared) {
  run(fusion_, 0, 7, 20);
  declare(7, kLeft, 40);
  EXPECT_EQ(run(fusion_, 7, 10, 20).track_probability, 0.9995);
  landmark(10, kStraight, 100);
  declare(10.1, kLeft, 102);
  auto state = run(fusion_, 10, 12, 20);
  EXPECT_EQ(state.position.edge, kLeft);
  EXPECT_LT(state.track_probability, 0.01);
  EXPECT_EQ(state.integrity, Integrity::degraded);
  declare(12, kStraight, 140);
  state = run(fusion_, 12, 13, 20);
  EXPECT_EQ(state.position.edge, kStraight);
  EXPECT_NEAR(state.position.offset_m, 160, 0.1);
  EXPECT_EQ(state.track_probability, 0.9995);
  EXPECT_THAT(state.reason, Not(HasSubstr("another track")));  // it spoke for this one
}

TEST_F(WrongLeg, ALandmarkOnTheTrackSettlesADoubt) {
  run(fusion_, 0, 7, 20);
  declare(7, kLeft, 40);
  landmark(8, kStraight, 60);
  EXPECT_LT(run(fusion_, 7, 10, 20).track_probability, 0.01);
  landmark(10, kLeft, 100);
  EXPECT_EQ(run(fusion_, 10, 11, 20).track_probability, 0.9995);
}

TEST_F(WrongLeg, ATrainThatTurnsOtherwiseDoubtsIt) {
  go(0, 7, 0);
  declare(7, kLeft, 40);
  auto state = go(7, 12, 0);
  EXPECT_EQ(state.track_probability, 0.5);
  EXPECT_THAT(state.reason, HasSubstr("turns otherwise"));
  declare(12, kLeft, 140);
  EXPECT_EQ(go(12, 13, 0).track_probability, 0.5);
  declare(13, kStraight, 160);
  state = go(13, 20, 0);
  EXPECT_EQ(state.position.edge, kStraight);
  EXPECT_NEAR(state.position.offset_m, 300, 0.5);
  EXPECT_EQ(state.track_probability, 0.9995);
  EXPECT_THAT(state.reason, Not(HasSubstr("turns otherwise")));
}

// What is sighted is looked for on the leg that is believed, and masts stand beside both.
TEST_F(WrongLeg, AMastBesideItDoesNotSettleWhatTheTurnoutContradicts) {
  go(0, 7, 0);
  declare(7, kLeft, 40);
  go(7, 8, 0);
  landmark(8, kLeft, 60);
  EXPECT_EQ(go(8, 13, 0).track_probability, 0.5);
  landmark(13, kLeft, 160);
  EXPECT_EQ(go(13, 13.1, 0).track_probability, 0.5) << "the points are no 12 s behind it";
  go(13.1, 25, 0.001);
  landmark(25, kLeft, 400);
  EXPECT_EQ(go(25, 25.1, 0.001).track_probability, 0.9995) << "nothing speaks against it any more";
}

// On the turnout it has turned, or not, before anybody said which leg it took.
TEST_F(WrongLeg, ADeclarationThatTheTurnoutBehindContradictsIsDoubtedAtOnce) {
  go(0, 11, 0);
  declare(11, kLeft, 120);
  const auto state = go(11, 11.1, 0);
  EXPECT_EQ(state.position.edge, kLeft);
  EXPECT_EQ(state.track_probability, 0.5);
  EXPECT_THAT(state.reason, HasSubstr("turns otherwise"));
  declare(11.2, kStraight, 124);
  EXPECT_EQ(go(11.2, 12.2, 0).track_probability, 0.9995);
}

TEST_F(WrongLeg, ThatItGoesStraightOnIsDoubtedWhereTheTrainHasTurned) {
  go(0, 5, 0);
  go(5, 7.5, 0.001);
  declare(7.5, kStraight, 50);
  EXPECT_EQ(go(7.5, 7.9, 0.001).track_probability, 0.5);
  declare(7.9, kLeft, 58);
  EXPECT_EQ(go(7.9, 9, 0.001).track_probability, 0.9995);
}

TEST_F(WrongLeg, ATrainThatTurnsAsTheTrackDoesDoubtsNothing) {
  go(0, 5, 0);
  go(5, 7, 0.001);
  declare(7, kLeft, 40);
  const auto state = go(7, 30, 0.001);
  EXPECT_EQ(state.track_probability, 0.9995);
  EXPECT_THAT(state.reason, Not(HasSubstr("turns otherwise")));
}

TEST_F(WrongLeg, TheRightOneIsNeverRefusedHoweverLate) {
  run(fusion_, 0, 7, 20);
  declare(7, kLeft, 40);
  run(fusion_, 7, 300, 20);
  declare(300, kStraight, 5900);
  const auto state = run(fusion_, 300, 301, 20);
  EXPECT_EQ(state.position.edge, kStraight);
  EXPECT_NEAR(state.position.offset_m, 5920, 1);
}

TEST_F(WrongLeg, AStartOnAnotherTrackIsDoubtedInItsFirstBend) {
  EXPECT_EQ(go(0, 4, 0).track_probability, 1);
  const auto state = go(4, 10, 0.001);  // on the stem, which is straight
  EXPECT_EQ(state.track_probability, 0.5);
  EXPECT_THAT(state.reason, HasSubstr("turns otherwise"));
  landmark(10, 2, 100);
  EXPECT_EQ(go(10, 10.5, 0).track_probability, 0.5) << "its first sight of anything fits";
}

// As map_matcher does when the landmarks that are sighted fit the map nowhere near the place: see its `elsewhere`.
TEST_F(WrongLeg, APlaceThatWhatIsSeenContradictsIsDoubtedUntilItFits) {
  run(fusion_, 0, 1, 20);
  const auto said = [&](double t_s, double probability) {
    fusion_.add(
        FixInput{at(t_s), 1, 900 + 20 * t_s, INFINITY, probability, 0, FixKind::track, track::Direction::forward, {}});
  };
  said(1, 0.004);
  auto state = run(fusion_, 1, 2, 20);
  EXPECT_EQ(state.track_probability, 0.004);
  EXPECT_EQ(state.integrity, Integrity::degraded);
  EXPECT_THAT(state.reason, HasSubstr("far more probable"));
  said(2, 0.9999);
  state = run(fusion_, 2, 3, 20);
  EXPECT_EQ(state.track_probability, 0.9999);
  EXPECT_THAT(state.reason, Not(HasSubstr("far more probable")));
}

// The short form of railfix-measure-confidence --fault "fix:wrong branch".
TEST(WrongLegDeclared, TheIntervalHoldsAlongTheTrackAndTheLegIsDoubted) {
  train::Verdict sum;
  for (uint64_t seed = 1; seed <= 12; ++seed) {
    train::SimulationPlan plan;
    plan.duration_s = 150;
    plan.false_fix_share = 0.005;
    plan.fix_probability = 0.995;
    plan.track_fixes = true;
    plan.switch_spacing_m = 800;
    core::Random random(seed);
    plan.fault = train::random_fault(random, train::Sensor::fix, train::FaultKind::wrong_branch, plan.duration_s);
    const train::TrainSimulation simulation(plan, seed);
    auto fusion = core::value_or_throw(Fusion::create({}, simulation.map, simulation.start()));
    sum.add(train::judge(simulation, fusion));
  }
  std::cout << sum.way_m / 1000 << " km, " << sum.states << " states, " << sum.other_leg << " on the other leg, "
            << sum.other_leg_sure << " of them declared and ok, for up to " << sum.other_leg_sure_s << " s\n";
  EXPECT_EQ(sum.outside, 0U);
  EXPECT_GT(sum.other_leg, 1000U);                    // it was injected
  EXPECT_LT(10 * sum.other_leg_sure, sum.other_leg);  // legs that turn alike without a landmark: nobody can know
  EXPECT_LT(sum.other_leg_sure_s, 10);
}

}  // namespace
}  // namespace railfix::fusion
