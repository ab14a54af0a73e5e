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
  void expect_behind(uint32_t nid_lrbg, double foot_m) {
    const auto found = tracker.behind(nid_lrbg);
    ASSERT_TRUE(found.has_value());
    EXPECT_EQ(found->group->nid_lrbg(), nid_lrbg);
    EXPECT_NEAR(found->foot_m, foot_m, 1e-9);
  }
};

TEST_F(RememberedGroups, KeepTheWayThatWasRun) {
  run(1, 40, 996);
  run(2, 0, 240);
  expect(kD, 40);
  expect_behind(kD, 40);
  expect_behind(kC, 540);
  expect_behind(kB, 840);
  expect_behind(kA, 1140);
  EXPECT_EQ(tracker.remembered(kB)->previous->nid_lrbg(), kA);
  EXPECT_FALSE(tracker.remembered(kB)->nominal_along);
  EXPECT_FALSE(tracker.behind(kE).has_value()) << "of the other leg";
}

TEST_F(RememberedGroups, AGroupOfTheMapIsNoneThatWasPassed) {
  run(1, 460, 500);
  expect(kB, 100);
  EXPECT_FALSE(tracker.remembered(kA).has_value());
  expect_behind(kA, 400);
  EXPECT_FALSE(tracker.behind(kC).has_value()) << "ahead";
  run(1, 500, 720);
  EXPECT_TRUE(tracker.remembered(kC)->passed);
}

TEST_F(RememberedGroups, NoFartherThanOneIsLookedForAtTheStart) {
  tracker = BaliseTracker(balise_map(), 550);
  run(1, 40, 720);
  expect_behind(kC, 20);
  expect_behind(kB, 320);
  EXPECT_FALSE(tracker.remembered(kA).has_value()) << "600 m before C";
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

}  // namespace
}  // namespace railfix::tpr_publisher
