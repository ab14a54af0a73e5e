// The groups that a train has passed before its LRBG, and those that lie behind its front end at the start.
#include <gtest/gtest.h>

#include "unit/tpr_publisher/tracker_fixture.hpp"

namespace railfix::tpr_publisher {
namespace {

using namespace testing;

class RememberedGroups : public TrackerFixture {
 protected:
  void run(uint32_t edge, double from_m, double to_m) {
    for (double m = from_m; m <= to_m; m += 4) tracker.update(forward(edge, m), true);
  }
  void expect_found(uint32_t nid_lrbg, double foot_m) {
    const auto found = tracker.find(nid_lrbg, 0);
    ASSERT_TRUE(found.has_value());
    EXPECT_EQ(found->group->nid_lrbg(), nid_lrbg);
    EXPECT_NEAR(found->foot_m, foot_m, 1e-9);
  }
};

TEST_F(RememberedGroups, KeepTheWayThatWasRun) {
  run(1, 40, 996);
  run(2, 0, 240);
  expect(kD, 40);
  expect_found(kD, 40);
  expect_found(kC, 540);
  expect_found(kB, 840);
  expect_found(kA, 1140);
  EXPECT_EQ(tracker.find(kB, 0)->previous->nid_lrbg(), kA);
  EXPECT_FALSE(tracker.find(kB, 0)->nominal_along);
  EXPECT_FALSE(tracker.find(kE, 0).has_value()) << "of the other leg";
}

TEST_F(RememberedGroups, BehindATrainThatBeginsAreThoseOfTheMap) {
  run(1, 460, 500);
  expect(kB, 100);
  expect_found(kA, 400);
  EXPECT_FALSE(tracker.find(kA, 0)->passed);
  run(1, 500, 720);
  expect_found(kA, 620);
  EXPECT_TRUE(tracker.find(kC, 0)->passed);
}

TEST_F(RememberedGroups, AheadIsWhereOnlyOneWayLeads) {
  run(1, 660, 692);
  EXPECT_FALSE(tracker.find(kC, 5).has_value());
  EXPECT_NEAR(tracker.find(kC, 20)->foot_m, -8, 1e-9);
  EXPECT_FALSE(tracker.find(kD, 2000).has_value()) << "beyond points";
}

TEST_F(RememberedGroups, OfSeveralPassagesTheOneThatIsExpected) {
  const auto map = balise_map();
  const auto* group = &map->balise_groups[0];
  const Reference once_round{
      group, nullptr, true, true, 30, 0, 30, true, {{group, nullptr, true, true, 1000, 0, true}}};
  EXPECT_EQ(once_round.remembered(kA)->foot_m, 30);
  EXPECT_EQ(once_round.remembered(kA, 990)->foot_m, 1030);
  EXPECT_EQ(once_round.remembered(kA, 60)->foot_m, 30);
}

TEST_F(RememberedGroups, NoFartherThanOneIsLookedForAtTheStart) {
  tracker = BaliseTracker(balise_map(), 550);
  run(1, 40, 720);
  expect_found(kC, 20);
  expect_found(kB, 320);
  EXPECT_FALSE(tracker.find(kA, 0).has_value()) << "600 m before C";
}

TEST_F(RememberedGroups, BehindAFrontAtTheOtherEndIsWhatTheCameraSeesAhead) {
  tracker.update(forward(1, 600), true);
  expect(kB, 200);
  tracker.turn_front(true);
  expect(kC, -100);
  EXPECT_EQ(previous(), 0U) << "behind the switch two ways lead on";
  tracker.turn_front(false);
  expect(kB, 200);
  EXPECT_EQ(previous(), kA);
}

TEST_F(RememberedGroups, AGroupThatWasPassedStaysWhenTheFrontTurns) {
  run(1, 360, 600);
  expect(kB, 200);
  tracker.turn_front(true);
  expect(kB, 200);
}

TEST_F(RememberedGroups, TheCabThatWasTakenForTheActiveOneChangesNothing) {
  for (double m = 420; m < 500; m += 4) tracker.update(forward(3, m), true);
  for (double m = 2; m < 90; m += 4) tracker.update(reverse(1, 1000 - m), true);
  expect(kE, 186);
  tracker.turn_front(false);
  expect(kE, 186);
}

TEST_F(RememberedGroups, WithNothingBehindTheCameraThereMayBeAGroupBehindTheTurnedFront) {
  tracker.update(forward(1, 99), true);
  EXPECT_FALSE(tracker.reference().has_value());
  tracker.turn_front(true);
  expect(kA, -1);
}

TEST_F(RememberedGroups, AFrontThatTurnsWhileTheLegIsAGuessHasItsGroupWhenThatIsDeclared) {
  tracker.update(forward(1, 990), true);
  expect(kC, 290);
  for (double m = 2; m < 100; m += 4) tracker.update(forward(2, m), false);
  tracker.turn_front(true);
  tracker.update(forward(2, 100), true);
  expect(kD, -100);
}

TEST_F(RememberedGroups, AStepIsTheWayOnTheMap) {
  tracker.update(forward(1, 990), true);
  EXPECT_EQ(tracker.step_m(), std::nullopt);
  tracker.update(forward(1, 996), true);
  EXPECT_NEAR(tracker.step_m().value(), 6, 1e-9);
  tracker.update(forward(2, 4), false);
  EXPECT_NEAR(tracker.step_m().value(), 8, 1e-9);
  tracker.update(reverse(3, 490), true);  // the other leg
  EXPECT_NEAR(tracker.step_m().value(), 6, 1e-9);
  tracker.lose();
  tracker.update(reverse(3, 480), true);
  EXPECT_EQ(tracker.step_m(), std::nullopt);
}

}  // namespace
}  // namespace railfix::tpr_publisher
