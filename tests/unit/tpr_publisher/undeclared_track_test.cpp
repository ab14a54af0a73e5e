// What the reports refer to while nobody knows which leg of a switch the train took.
#include <gmock/gmock.h>

#include <cmath>

#include "core/time.hpp"
#include "tpr_publisher/tpr_publisher.hpp"
#include "unit/tpr_publisher/tracker_fixture.hpp"

namespace railfix::tpr_publisher {
namespace {

using namespace testing;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

TEST(Turns, LeaveOutWhatALongerStretchRunsOverAgain) {
  Turns turns;
  for (const double step_m : {100.0, 200.0, -150.0, 100.0}) turns.run(step_m);
  EXPECT_THAT(turns.points(), ElementsAre(0, 300, 150, 250));
  turns.run(60);
  EXPECT_THAT(turns.points(), ElementsAre(0, 310));
  for (int i = 0; i < 1000; ++i) turns.run(i % 2 == 0 ? 0.01 : -0.01);
  EXPECT_LE(turns.points().size(), 4U);
}

/// Follows the straight leg, or the siding, before it is known which one it is.
class UndeclaredTrack : public TrackerFixture {
 protected:
  /// 250 m beyond the switch on the straight leg, beyond its group D; E of the siding lies 100 m beyond the switch.
  void run_past_the_groups() {
    tracker.update(forward(1, 990), true);
    for (double offset_m = 10; offset_m <= 250; offset_m += 20) tracker.update(forward(2, offset_m), false);
  }
};

TEST_F(UndeclaredTrack, NoGroupIsTakenBehindTheSwitch) {
  run_past_the_groups();
  expect(kC, 550);
  EXPECT_NEAR(*tracker.undeclared_m(), 260, 1e-9);
  EXPECT_EQ(previous(), kB);
}

TEST_F(UndeclaredTrack, DeclaredAsFollowedItsGroupsCountAsPassed) {
  run_past_the_groups();
  tracker.update(forward(2, 252), true);
  expect(kD, 52);
  EXPECT_EQ(previous(), kC);
  EXPECT_TRUE(tracker.reference()->from_previous_along);
  EXPECT_FALSE(tracker.undeclared_m().has_value());
  tracker.update(forward(2, 262), true);
  expect(kD, 62);
}

TEST_F(UndeclaredTrack, DeclaredAsTheOtherLegItsGroupsCountAndNoOthers) {
  run_past_the_groups();
  tracker.update(reverse(3, 248), true);  // 252 m beyond the switch, the siding is drawn towards it
  expect(kE, 152);
  EXPECT_EQ(previous(), kC);
  EXPECT_FALSE(tracker.reference()->nominal_along);
  EXPECT_NEAR(tracker.reference()->doubt_m, 0, 1e-9);
}

TEST_F(UndeclaredTrack, DeclaredBeforeTheOtherLegsGroupNothingIsTaken) {
  tracker.update(forward(1, 990), true);
  tracker.update(forward(2, 90), false);
  tracker.update(reverse(3, 405), true);
  expect(kC, 395);
  tracker.update(reverse(3, 395), true);
  expect(kE, 5);
}

TEST_F(UndeclaredTrack, BackOnTheStemNothingWasPassed) {
  run_past_the_groups();
  for (double offset_m = 240; offset_m > 0; offset_m -= 20) tracker.update(forward(2, offset_m), false);
  tracker.update(forward(1, 980), true);
  expect(kC, 280);
  EXPECT_EQ(previous(), kB);
  tracker.update(forward(1, 690), true);
  expect(kC, -10);
  tracker.update(forward(1, 390), true);
  expect(kB, -10);
}

TEST_F(UndeclaredTrack, TurnedBackOverAGroupBeforeItWasDeclared) {
  run_past_the_groups();
  for (double offset_m = 240; offset_m > 80; offset_m -= 20) tracker.update(forward(2, offset_m), false);
  expect(kC, 400);
  tracker.update(forward(2, 90), true);
  expect(kD, -110);
  EXPECT_TRUE(tracker.reference()->from_previous_along);
  EXPECT_EQ(previous(), kC);
}

TEST_F(UndeclaredTrack, StandsOnTheSwitch) {
  tracker.update(forward(1, 995), true);
  for (int i = 0; i < 1000; ++i) {
    tracker.update(forward(2, 1), false);
    tracker.update(forward(1, 999), true);
  }
  expect(kC, 299);
  tracker.update(forward(2, 1), false);
  expect(kC, 301);
  tracker.update(forward(2, 1), true);
  expect(kC, 301);
}

TEST_F(UndeclaredTrack, BackwardsOverAFacingSwitch) {
  // Cab towards the switch, train backing out of the siding's neighbour: from edge 1 backwards onto either leg.
  tracker.update(reverse(1, 650), true);
  tracker.update(reverse(1, 750), true);  // backs over C
  expect(kC, -50);
  tracker.update(reverse(2, 10), false);
  tracker.update(reverse(2, 250), false);
  expect(kC, -550);
  tracker.update(forward(3, 250), true);
  expect(kE, -150);
  EXPECT_EQ(previous(), kC);
  EXPECT_FALSE(tracker.reference()->from_previous_along);
}

TEST_F(UndeclaredTrack, AtTheStartThereIsNoGroupUntilItIsDeclared) {
  tracker.update(forward(2, 250), false);
  EXPECT_FALSE(tracker.reference().has_value());
  tracker.update(forward(2, 260), false);
  EXPECT_FALSE(tracker.reference().has_value());
  tracker.update(reverse(3, 240), true);
  expect(kE, 160);
}

TEST_F(UndeclaredTrack, AJumpElsewhereLosesTheGroupUntilItIsDeclared) {
  tracker.update(forward(1, 990), true);
  tracker.update(forward(2, 10), false);
  tracker.update(forward(3, 450), false);  // the cab has turned
  EXPECT_FALSE(tracker.reference().has_value());
  tracker.update(forward(3, 451), true);
  expect(kE, 51);
}

TEST_F(UndeclaredTrack, MovedOntoAnotherLegBehindWhichTheNextSwitchIsOpen) {
  run_past_the_groups();
  tracker.update(reverse(3, 248), false);
  expect(kC, 552);
  tracker.update(reverse(3, 246), true);
  expect(kE, 154);
}

TEST_F(UndeclaredTrack, ADeclarationThatIsTakenBackTakesItsGroupsAlong) {
  run_past_the_groups();
  tracker.update(forward(2, 252), true);
  for (double offset_m = 260; offset_m <= 700; offset_m += 20) tracker.update(forward(2, offset_m), true);
  expect(kD, 500);
  tracker.update(forward(2, 720), false);
  expect(kC, 1020);
  EXPECT_EQ(previous(), kB);
  EXPECT_NEAR(*tracker.undeclared_m(), 730, 1e-9);
  tracker.update(forward(2, 740), true);
  expect(kD, 540);
}

TEST_F(UndeclaredTrack, AnotherLegThanWasDeclaredCountsFromTheSwitch) {
  run_past_the_groups();
  tracker.update(forward(2, 252), true);
  tracker.update(forward(2, 262), true);
  expect(kD, 62);
  tracker.update(reverse(3, 228), true);
  expect(kE, 172);
  EXPECT_EQ(previous(), kC) << "D was never passed";
  tracker.update(reverse(3, 218), false);
  expect(kC, 582);
}

TEST_F(UndeclaredTrack, DoubtedAfreshAtTheNextSwitchTheGroupOfTheStemStays) {
  run_past_the_groups();
  tracker.update(forward(2, 252), true);
  for (double offset_m = 240; offset_m > 0; offset_m -= 20) tracker.update(forward(2, offset_m), true);
  tracker.update(forward(1, 980), true);
  expect(kD, -220);  // passed there and back
  tracker.update(forward(2, 10), false);
  expect(kC, 310);  // D lies on one of the legs, and nobody knows whether on this one
}

TEST_F(UndeclaredTrack, DoubtedWithoutASwitchNoGroupIsKnown) {
  tracker.update(forward(1, 450), true);
  tracker.update(forward(1, 500), true);
  tracker.update(forward(1, 520), false);
  EXPECT_FALSE(tracker.reference().has_value());
  tracker.update(forward(1, 720), false);
  EXPECT_FALSE(tracker.reference().has_value());
  tracker.update(forward(1, 740), true);
  expect(kC, 40);
}

TEST_F(UndeclaredTrack, DoubtedALittleBeforeTheSwitchTheGroupStays) {
  tracker.update(forward(1, 990), true);
  tracker.update(forward(1, 995), false);
  expect(kC, 295);
  tracker.update(forward(2, 5), false);
  tracker.update(forward(2, 250), false);
  expect(kC, 550);
  tracker.update(reverse(3, 248), true);
  expect(kE, 152);
}

/// A loop whose siding is longer than the straight track; groups A 100 on 1, D 200 on 2, E 200 on 3, B 100 on 4.
std::shared_ptr<const track::Map> loop_map(double longer_m = 5) {
  using track::Alignment;
  auto map = std::make_shared<track::Map>();
  const auto straight = [](double from_m, double length_m) {
    return Alignment::chained({from_m, 0, core::kPi / 2}, {{length_m, 0, 0}});
  };
  map->edges = {{1, "stem", 1, 2, "", straight(0, 1000)},
                {2, "straight", 2, 3, "", straight(1000, 400)},
                {3, "siding", 2, 3, "", straight(1000, 400 + longer_m)},
                {4, "on", 3, 4, "", straight(1400, 1000)}};
  map->connections = {{2, 1, 2, false}, {2, 1, 3, true}, {3, 2, 4, false}, {3, 3, 4, true}};
  map->balise_groups = {{85, 1, 1, 100, true, false, 5, {1, 2}},
                        {85, 4, 2, 200, true, true, 5, {}},
                        {85, 5, 3, 200, true, true, 5, {}},
                        {85, 2, 4, 100, true, true, 5, {}}};
  return map;
}

TEST(UndeclaredLoop, WhereLegsMeetAgainTheirGroupsAreLeftOutAndTheirLengthsAreDoubt) {
  BaliseTracker tracker(loop_map(), 5000);
  tracker.update(forward(1, 900), true);
  for (double offset_m = 20; offset_m < 400; offset_m += 20) tracker.update(forward(2, offset_m), false);
  tracker.update(forward(4, 20), true);
  ASSERT_TRUE(tracker.reference().has_value());
  EXPECT_EQ(tracker.reference()->group->nid_lrbg(), kA);
  EXPECT_NEAR(tracker.reference()->foot_m, 1320, 1e-6);
  EXPECT_NEAR(tracker.reference()->doubt_m, 5, 1e-6);
  tracker.update(forward(4, 110), true);
  EXPECT_EQ(tracker.reference()->group->nid_lrbg(), kB);
  EXPECT_EQ(tracker.reference()->doubt_m, 0);
}

TEST(UndeclaredLoop, AGroupBeyondTheLoopIsTakenWhicheverLegItWas) {
  BaliseTracker tracker(loop_map(), 5000);
  tracker.update(forward(1, 900), true);
  for (double offset_m = 20; offset_m < 400; offset_m += 20) tracker.update(forward(2, offset_m), false);
  tracker.update(forward(4, 110), false);
  EXPECT_EQ(tracker.reference()->group->nid_lrbg(), kA);
  tracker.update(forward(4, 120), true);
  EXPECT_EQ(tracker.reference()->group->nid_lrbg(), kB);
  EXPECT_NEAR(tracker.reference()->foot_m, 20, 1e-6);
  EXPECT_NEAR(tracker.reference()->doubt_m, 0, 1e-6);
  EXPECT_EQ(tracker.reference()->previous->nid_lrbg(), kA);
}

TEST(UndeclaredLoop, TakenBackBeyondTheLoopItsLegsAreDoubtAgain) {
  for (const double longer_m : {5.0, 120.0}) {
    BaliseTracker tracker(loop_map(longer_m), 5000);
    tracker.update(forward(1, 900), true);
    tracker.update(forward(2, 20), false);
    for (double offset_m = 40; offset_m < 400; offset_m += 20) tracker.update(forward(2, offset_m), true);
    tracker.update(forward(4, 20), true);
    EXPECT_EQ(tracker.reference()->group->nid_lrbg(), kD);
    tracker.update(forward(4, 40), false);
    EXPECT_EQ(tracker.reference()->group->nid_lrbg(), kA);
    EXPECT_NEAR(tracker.reference()->foot_m, 1340, 1e-6);
    EXPECT_NEAR(tracker.reference()->doubt_m, longer_m, 1e-6);
    tracker.update(forward(4, 60), false);
    EXPECT_NEAR(tracker.reference()->doubt_m, longer_m, 1e-6);
  }
}

TEST(UndeclaredLoop, BackInFrontOfTheJointTheLegThatIsFollowedIsTheOnlyOne) {
  BaliseTracker tracker(loop_map(), 5000);
  tracker.update(forward(1, 900), true);
  for (double offset_m = 20; offset_m < 400; offset_m += 20) tracker.update(forward(2, offset_m), false);
  EXPECT_EQ(tracker.reference()->doubt_m, 0);
  tracker.update(forward(4, 20), false);
  EXPECT_NEAR(tracker.reference()->doubt_m, 5, 1e-6);
  tracker.update(forward(2, 380), false);
  EXPECT_EQ(tracker.reference()->doubt_m, 0);
  tracker.update(forward(2, 370), true);
  EXPECT_EQ(tracker.reference()->group->nid_lrbg(), kD);
  EXPECT_EQ(tracker.reference()->doubt_m, 0);
}

/// At 20 m/s from 990 m on the stem over the switch, five positions a second.
class UndeclaredReports : public ::testing::Test {
 protected:
  static constexpr int64_t kStart = 1'700'000'000'000'000'000;
  static constexpr double kPeriodS = 0.2;

  static Settings settings() {
    Settings settings;
    settings.parameters.t_cycloc = 2;
    return settings;
  }
  std::optional<Report> step(const track::EdgePosition& foot, double probability, double over_m = 3) {
    TrainPosition position;
    position.stamp_ns = kStart + core::to_ns(run_s_);
    position.foot = foot;
    position.track_known = true;
    position.track_probability = probability;
    position.speed_mps = 20;
    position.distance_m = 20 * run_s_;
    position.over_m = position.under_m = over_m;
    run_s_ += kPeriodS;
    auto outcome = publisher.update(position, position.stamp_ns);
    EXPECT_EQ(outcome.refusal, "");
    if (outcome.report) last = outcome.report->fields;
    return outcome.report;
  }
  void run(double to_m, double over_m = 3) {
    for (; beyond_m < to_m; beyond_m += 20 * kPeriodS) {
      step(beyond_m < 0 ? forward(1, 1000 + beyond_m) : forward(2, beyond_m), beyond_m < 0 ? 1 : 0.5, over_m);
    }
  }
  TprPublisher publisher{balise_map(), settings()};
  double beyond_m = -10;
  etcs::TrainPositionReport last;

 private:
  double run_s_ = 0;
};

TEST_F(UndeclaredReports, ReferToTheGroupBeforeTheSwitch) {
  run(450);
  EXPECT_EQ(last.nid_lrbg, kC);
  EXPECT_EQ(last.nid_packet, 1U);
  EXPECT_EQ(last.nid_prvlrbg, kB);
  EXPECT_EQ(last.q_dirlrbg, etcs::kNominal);
  EXPECT_EQ(last.q_dlrbg, etcs::kNominal);
  EXPECT_NEAR(last.d_lrbg * 0.1, 300 + beyond_m, 45);
  EXPECT_EQ(last.l_doubtover, 80U);  // 3 m and the 5 m of the group
  EXPECT_EQ(publisher.undeclared(), "");

  const auto report = step(reverse(3, 500 - beyond_m), 0.9995);
  ASSERT_TRUE(report.has_value());
  EXPECT_EQ(report->reason, Reason::balise_group);
  EXPECT_EQ(report->fields.nid_lrbg, kE);
  EXPECT_EQ(report->fields.nid_packet, 0U);
  EXPECT_EQ(report->fields.q_dirlrbg, etcs::kReverse);
  EXPECT_EQ(report->fields.q_dlrbg, etcs::kReverse);
  EXPECT_EQ(report->fields.q_dirtrain, etcs::kReverse);
  EXPECT_NEAR(report->fields.d_lrbg * 0.1, beyond_m - 100, 0.051);
}

TEST_F(UndeclaredReports, SayOnlyAfterALongWayThatTheTrackIsNotDeclared) {
  run(480);
  EXPECT_EQ(publisher.undeclared(), "");
  run(520);
  EXPECT_THAT(publisher.undeclared(), HasSubstr("not been declared"));
  step(forward(2, beyond_m), 1);
  EXPECT_EQ(publisher.undeclared(), "");
}

TEST_F(UndeclaredReports, ALandmarkOfTheGuessedLegNarrowsNothing) {
  run(100, 6);
  beyond_m += 4;  // a mast of the straight leg moves the place on, and its interval shrinks
  run(180, 0.5);
  EXPECT_EQ(last.l_doubtunder, 110U);  // 6 m as before, 5 m of the group
  EXPECT_EQ(last.l_doubtover, 150U);   // ... and the 4 m that it was moved
  step(forward(2, beyond_m), 1, 0.5);
  for (int i = 0; i < 12; ++i) step(forward(2, beyond_m += 4), 1, 0.5);
  EXPECT_EQ(last.l_doubtover, 55U);
}

TEST_F(UndeclaredReports, ADeclarationThatIsTakenBackIsNoCorrectionOfThePlace) {
  run(100);
  for (; beyond_m < 300; beyond_m += 4) step(forward(2, beyond_m), 0.9995);
  EXPECT_EQ(last.nid_lrbg, kD);
  const auto report = step(forward(2, beyond_m), 0.5);
  ASSERT_TRUE(report.has_value());
  EXPECT_EQ(report->fields.nid_lrbg, kC);
  EXPECT_NEAR(report->fields.d_lrbg * 0.1, 300 + beyond_m, 0.051);
  EXPECT_EQ(report->fields.l_doubtover, 80U);
  EXPECT_EQ(report->fields.l_doubtunder, 80U);
}

TEST_F(UndeclaredReports, AProbabilityThatIsNoneDeclaresNothing) {
  run(0);
  for (; beyond_m < 260; beyond_m += 4) step(forward(2, beyond_m), NAN);
  EXPECT_EQ(last.nid_lrbg, kC);
}

}  // namespace
}  // namespace railfix::tpr_publisher
