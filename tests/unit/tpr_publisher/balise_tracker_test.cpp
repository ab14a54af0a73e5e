#include <cmath>
#include <vector>

#include "unit/tpr_publisher/tracker_fixture.hpp"

namespace railfix::tpr_publisher {
namespace {

using namespace testing;

using Tracker = TrackerFixture;

TEST_F(Tracker, KnowsNoGroupBeforeTheFirst) {
  tracker.update(forward(1, 50), true);
  EXPECT_FALSE(tracker.reference().has_value());
  tracker.update(forward(1, 99), true);
  EXPECT_FALSE(tracker.reference().has_value());
  tracker.update(forward(1, 100), true);
  expect(kA, 0);
  EXPECT_EQ(previous(), 0U);
  EXPECT_TRUE(tracker.reference()->nominal_along);
}

TEST_F(Tracker, TakesTheGroupsBehindAtTheStart) {
  tracker.update(forward(1, 450), true);
  expect(kB, 50);
  EXPECT_EQ(previous(), kA);
  EXPECT_FALSE(tracker.reference()->nominal_along);
}

TEST_F(Tracker, PassesSeveralGroupsInOneStep) {
  tracker.update(forward(1, 50), true);
  tracker.update(forward(1, 705), true);
  expect(kC, 5);
  EXPECT_EQ(previous(), kB);
  EXPECT_TRUE(tracker.reference()->from_previous_along);
}

TEST_F(Tracker, RollingBackKeepsTheGroupUntilAnotherIsPassed) {
  tracker.update(forward(1, 410), true);
  tracker.update(forward(1, 390), true);
  expect(kB, -10);
  tracker.update(forward(1, 410), true);
  expect(kB, 10);
  tracker.update(forward(1, 90), true);
  expect(kA, -10);
  EXPECT_EQ(previous(), kB);
  EXPECT_FALSE(tracker.reference()->from_previous_along);
}

TEST_F(Tracker, JitterOnAGroupChangesNothing) {
  tracker.update(forward(1, 399), true);
  for (int i = 0; i < 10; ++i) {
    tracker.update(forward(1, 400.2), true);
    expect(kB, 0.2);
    tracker.update(forward(1, 399.8), true);
    expect(kB, -0.2);
    EXPECT_EQ(previous(), kA);
  }
}

TEST_F(Tracker, GoesStraightOverTheSwitch) {
  tracker.update(forward(1, 990), true);
  tracker.update(forward(2, 10), true);
  expect(kC, 310);
  tracker.update(forward(2, 205), true);
  expect(kD, 5);
  EXPECT_EQ(previous(), kC);
}

TEST_F(Tracker, GoesOverTheDivergingWay) {
  tracker.update(forward(1, 990), true);
  tracker.update(reverse(3, 490), true);  // the siding is drawn the other way
  expect(kC, 310);
  tracker.update(reverse(3, 390), true);
  expect(kE, 10);
  EXPECT_FALSE(tracker.reference()->nominal_along);
}

TEST_F(Tracker, ComesOutOfTheSidingWithTheRightGroup) {
  tracker.update(forward(3, 450), true);
  expect(kE, 50);
  tracker.update(reverse(1, 990), true);
  expect(kE, 110);  // the straight way back from here would lead to D
  tracker.update(reverse(1, 690), true);
  expect(kC, 10);
  EXPECT_EQ(previous(), kE);
  EXPECT_FALSE(tracker.reference()->nominal_along);
}

TEST_F(Tracker, BacksOverTheSwitch) {
  tracker.update(forward(2, 250), true);
  tracker.update(forward(2, 20), true);
  expect(kD, -180);
  tracker.update(forward(1, 980), true);
  expect(kD, -220);
  tracker.update(forward(1, 650), true);
  expect(kC, -50);
}

TEST_F(Tracker, StandsExactlyWhereEdgesMeet) {
  tracker.update(forward(1, 990), true);
  tracker.update(forward(1, 1000), true);
  tracker.update(forward(2, 0), true);
  expect(kC, 300);
  tracker.update(forward(2, 1), true);
  expect(kC, 301);
  EXPECT_EQ(previous(), kB);
}

TEST_F(Tracker, PassesAGroupWhereTheNextEdgeBeginsThoughItStandsThere) {
  auto map = std::make_shared<track::Map>(*balise_map());
  map->balise_groups[3].offset_m = 0;  // D
  tracker = BaliseTracker(map, 5000);
  tracker.update(forward(1, 950), true);
  tracker.update(forward(1, 1000), true);
  tracker.update(forward(2, 10), true);
  expect(kD, 10);
}

TEST_F(Tracker, AJumpToAnotherTrackStartsAnew) {
  tracker.update(forward(2, 250), true);
  tracker.update(forward(3, 450), true);
  expect(kE, 50);
  EXPECT_EQ(previous(), 0U);
}

TEST_F(Tracker, TurningTheCabStartsAnew) {
  tracker.update(forward(1, 450), true);
  tracker.update(reverse(1, 450), true);
  expect(kC, 250);
}

TEST_F(Tracker, LosesItselfOffTheMap) {
  tracker.update(forward(1, 450), true);
  tracker.update(forward(9, 450), true);
  EXPECT_FALSE(tracker.reference().has_value());
  tracker.update(forward(1, 450), true);
  expect(kB, 50);
}

TEST_F(Tracker, SearchesOnlySoFarBehind) {
  BaliseTracker near(balise_map(), 40);
  near.update(forward(1, 450), true);
  EXPECT_FALSE(near.reference().has_value());
  near.update(forward(2, 20), true);  // steps beyond 500 m are jumps
  EXPECT_FALSE(near.reference().has_value());
}

TEST_F(Tracker, WhereTracksHaveMetBehindTheTrainNoGroupIsTaken) {
  tracker.update(reverse(1, 900), true);  // from the line or from the siding, nobody knows
  EXPECT_FALSE(tracker.reference().has_value());
  tracker.update(reverse(1, 690), true);
  expect(kC, 10);
  EXPECT_EQ(previous(), 0U);
}

constexpr double kRoundM = 471;

/// A ring of one edge with D at 100 m.
std::shared_ptr<const track::Map> ring_map() {
  auto map = std::make_shared<track::Map>();
  const double curvature_per_m = 2 * core::kPi / kRoundM;
  map->edges = {
      {1, "ring", 1, 1, "", track::Alignment::chained({0, 0, 0}, {{kRoundM, curvature_per_m, curvature_per_m}})}};
  map->connections = {{1, 1, 1, false}};
  map->balise_groups = {{85, 4, 1, 100, true, true, 5, {}}};
  return map;
}

TEST(Ring, AGroupPassedAgainRoundARingIsPassedAnew) {
  BaliseTracker tracker(ring_map(), 5000);
  for (int i = 9; i <= 105; ++i) {
    tracker.update(forward(1, std::fmod(10.0 * i, kRoundM)), true);
    if (i < 10) continue;
    ASSERT_TRUE(tracker.reference().has_value());
    EXPECT_EQ(tracker.reference()->group->nid_lrbg(), kD);
    EXPECT_NEAR(tracker.reference()->foot_m, std::fmod(10.0 * i - 100, kRoundM), 1e-6);
  }
  EXPECT_EQ(tracker.passed_again(), 2U);
}

TEST(Ring, AGroupIsPassedAgainByATrainThatSetsBackAndNotByOneThatTrembles) {
  BaliseTracker tracker(ring_map(), 5000);
  const auto run = [&](const std::vector<double>& offsets_m) {
    for (const double offset_m : offsets_m) tracker.update(forward(1, offset_m), true);
    return tracker.passed_again();
  };
  const auto before = run({150, 120, 105, 99.5});
  EXPECT_EQ(run({100.2, 99.8, 100.1, 99.9, 100.3}), before);
  EXPECT_EQ(run({110, 120, 108, 95}), before + 1);
  EXPECT_EQ(run({92, 99, 105}), before + 2);
}

// Groups between were not passed, and what lies ahead is none that was.
TEST_F(Tracker, AJumpOnItsEdgePassesNothing) {
  tracker.update(forward(1, 950), true);
  expect(kC, 250);
  tracker.update(forward(1, 350), true);
  expect(kA, 250);
  EXPECT_FALSE(tracker.reference()->passed);
  EXPECT_EQ(tracker.taken_back(), 1U);
  EXPECT_FALSE(tracker.step_m().has_value());
}

}  // namespace
}  // namespace railfix::tpr_publisher
