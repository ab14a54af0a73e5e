// Trains that back out of a leg and take another one, and what a doubt near a switch leaves of the groups on its legs.
#include <gtest/gtest.h>

#include "unit/tpr_publisher/publisher_fixture.hpp"
#include "unit/tpr_publisher/tracker_fixture.hpp"

namespace railfix::tpr_publisher {
namespace {

using namespace testing;

/// A stem of 1000 m, two legs that join again (edge 2: 400 m, edge 3), and the line beyond (edge 4).
std::shared_ptr<const track::Map> loop(double siding_m) {
  auto map = std::make_shared<track::Map>();
  const auto straight = [](double from_m, double length_m) {
    return track::Alignment::chained({from_m, 0, core::kPi / 2}, {{length_m, 0, 0}});
  };
  map->edges = {{1, "stem", 1, 2, "", straight(0, 1000)},
                {2, "straight", 2, 3, "", straight(1000, 400)},
                {3, "siding", 2, 3, "", straight(1000, siding_m)},
                {4, "on", 3, 4, "", straight(1400, 1000)}};
  map->connections = {{2, 1, 2, false}, {2, 1, 3, true}, {3, 2, 4, false}, {3, 3, 4, true}};
  map->landmarks = {{1, track::LandmarkKind::balise, 2, 200, 0, 0, ""}};
  map->balise_groups = {
      {85, 1, 1, 100, true, true, 0, {}}, {85, 4, 2, 200, true, false, 0, {1}}, {85, 2, 4, 100, true, true, 0, {}}};
  return map;
}
constexpr uint32_t kOfLoop[] = {85U << 14U | 1U, 85U << 14U | 4U, 85U << 14U | 2U};

class LeftLeg : public TrackerFixture {
 protected:
  /// Over D of the straight leg, and back out onto the stem.
  void back_out() {
    run(1, 900, 998, 4, true);
    run(2, 2, 258, 4, true);
    run(2, 258, 2, -4, true);
    run(1, 998, 942, -4, true);
    expect(kD, -258);
    run(1, 946, 998, 4, true);
  }
  void run(uint32_t edge, double from_m, double to_m, double step_m, bool declared) {
    for (double m = from_m; step_m > 0 ? m <= to_m : m >= to_m; m += step_m) tracker.update(forward(edge, m), declared);
  }
};

TEST_F(LeftLeg, ItsGroupIsNoReferenceOnTheOtherLeg) {
  back_out();
  for (double m = 2; m < 90; m += 4) tracker.update(reverse(3, 500 - m), true);
  expect(kC, 386);
}

TEST_F(LeftLeg, ItsGroupIsNoReferenceWhileNobodyKnowsTheLeg) {
  back_out();
  for (double m = 2; m < 300; m += 4) tracker.update(reverse(3, 500 - m), false);
  expect(kC, 598);
}

TEST_F(LeftLeg, ItsGroupStaysTheReferenceOnItsOwnLeg) {
  back_out();
  run(2, 2, 90, 4, true);
  expect(kD, -110);
}

TEST_F(LeftLeg, AGroupBetweenTheSwitchAndTheDoubtIsNoneOfTheOtherLeg) {
  auto map = std::make_shared<track::Map>(*balise_map());
  map->balise_groups[3].offset_m = 10;  // D
  tracker = BaliseTracker(map, 5000);
  run(1, 900, 996, 4, true);
  run(2, 2, 26, 4, true);
  expect(kD, 16);
  run(2, 30, 398, 4, false);
  expect(kC, 698);
}

TEST_F(LeftLeg, ADoubtInFrontOfATrailingSwitchIsOfTheOneBehind) {
  tracker = BaliseTracker(loop(405), 5000);
  run(1, 900, 996, 4, true);
  run(2, 2, 378, 4, true);
  run(2, 380, 396, 4, false);
  run(4, 2, 60, 4, false);
  expect(kOfLoop[0], 900 + 400 + 58);
  EXPECT_NEAR(tracker.reference()->doubt_m, 5, 1e-6) << "it may have come over the siding";
  run(4, 61, 120, 1, true);
  expect(kOfLoop[2], 20);
}

// More loops, each 8 m longer on its siding, than there are ways to look at.
TEST_F(LeftLeg, WhereTooManyWaysHaveJoinedTheDoubtIsNoLess) {
  constexpr uint32_t kLoops = 14;
  auto map = std::make_shared<track::Map>();
  const auto straight = [](double length_m) {
    return track::Alignment::chained({0, 0, core::kPi / 2}, {{length_m, 0, 0}});
  };
  map->edges = {{1, "stem", 1, 2, "", straight(1000)}};
  map->balise_groups = {{85, 1, 1, 100, true, true, 0, {}}};
  uint32_t before = 1;
  for (uint32_t i = 0; i < kLoops; ++i) {
    const uint32_t node = 2 + 2 * i;
    const uint32_t edge = 2 + 3 * i;
    map->edges.push_back({edge, "straight", node, node + 1, "", straight(100)});
    map->edges.push_back({edge + 1, "siding", node, node + 1, "", straight(108)});
    map->edges.push_back({edge + 2, "on", node + 1, node + 2, "", straight(50)});
    map->connections.push_back({node, before, edge, false});
    map->connections.push_back({node, before, edge + 1, true});
    map->connections.push_back({node + 1, edge, edge + 2, false});
    map->connections.push_back({node + 1, edge + 1, edge + 2, true});
    before = edge + 2;
  }
  tracker = BaliseTracker(map, 5000);
  run(1, 900, 996, 4, true);
  for (uint32_t i = 0; i < kLoops; ++i) {
    run(2 + 3 * i, 2, 98, 4, false);
    run(4 + 3 * i, 2, 48, 4, false);
    ASSERT_TRUE(tracker.reference());
    EXPECT_GE(tracker.reference()->doubt_m, 8 * (i + 1) - 1e-6) << i;
  }
}

TEST_F(LeftLeg, TheWayFromTheGroupBeforeTellsTheDirectionAndNotTheLastStep) {
  tracker = BaliseTracker(loop(405), 5000);
  run(4, 150, 2, -4, true);  // back over the group beyond the loop, over a leg that nobody knows, and forward again
  run(2, 398, 2, -4, false);
  run(1, 998, 902, -4, true);
  run(1, 906, 998, 4, true);
  run(2, 2, 298, 4, true);
  expect(kOfLoop[1], 98);
  // The group beyond the loop lies in front of it, that of the stem behind.
  EXPECT_TRUE(previous() == 0 || tracker.reference()->from_previous_along == (previous() == kOfLoop[0]));
}

TEST_F(LeftLeg, OverWhichLegATrainWentThatWasNotHeardNobodyKnows) {
  tracker = BaliseTracker(loop(460), 5000);
  run(1, 900, 986, 4, true);
  tracker.update(forward(4, 10), true, false);
  EXPECT_FALSE(tracker.reference());
  run(1, 900, 986, 4, true);
  tracker = BaliseTracker(loop(460), 5000);
  run(1, 200, 300, 4, true);
  tracker.update(forward(1, 700), true, false);
  expect(kOfLoop[0], 600);
}

TEST_F(LeftLeg, AGroupAtTheVeryEndOfALegIsOnThatLeg) {
  auto map = std::make_shared<track::Map>(*loop(405));
  map->balise_groups[1].offset_m = 400;
  tracker = BaliseTracker(map, 5000);
  tracker.update(forward(4, 50), true);
  EXPECT_FALSE(tracker.reference());
}

/// In from the left over points, and over those of a third track out to the right.
std::shared_ptr<const track::Map> junction() {
  auto map = std::make_shared<track::Map>();
  const auto straight = [](double from_m, double length_m) {
    return track::Alignment::chained({from_m, 0, core::kPi / 2}, {{length_m, 0, 0}});
  };
  map->edges = {{1, "in", 1, 2, "", straight(0, 300)},
                {2, "middle", 2, 3, "", straight(300, 200)},
                {3, "out", 3, 4, "", straight(500, 300)},
                {4, "turned off", 2, 5, "", straight(300, 200)},
                {5, "third", 6, 3, "", straight(400, 100)}};
  map->connections = {{2, 1, 2, false}, {2, 1, 4, true}, {3, 2, 3, false}, {3, 5, 3, true}};
  map->balise_groups = {{85, 1, 1, 280, true, true, 0, {}}, {85, 2, 3, 50, true, true, 0, {}}};
  return map;
}

TEST_F(LeftLeg, BackedOverPointsInDoubtTheGroupOnOneOfTheirLegsIsNone) {
  tracker = BaliseTracker(junction(), 5000);
  run(1, 200, 298, 2, true);
  run(2, 2, 20, 2, false);
  run(2, 22, 198, 2, true);
  run(3, 2, 60, 2, true);
  expect(kOfLoop[2], 10);
  run(3, 60, 6, -2, true);
  run(3, 4, 2, -2, false);
  run(2, 198, 100, -2, false);
  EXPECT_FALSE(tracker.reference()) << "it may have backed onto the third track";
}

TEST_F(LeftLeg, ADoubtBeforeTheNextPointsIsOfTheOnesPassed) {
  for (const double doubted_m : {140.0, 160.0}) {
    auto map = std::make_shared<track::Map>(*junction());
    map->connections.push_back({3, 2, 5, true});  // facing as well
    map->balise_groups.push_back({85, 4, 2, 20, true, true, 0, {}});
    tracker = BaliseTracker(map, 5000);
    run(2, 10, doubted_m, 2, true);  // begun there
    EXPECT_EQ(tracker.reference()->group->nid_lrbg(), kOfLoop[1]);
    run(2, doubted_m + 2, 180, 2, false);
    expect(kOfLoop[0], 200);
  }
}

TEST_F(LeftLeg, ADoubtBehindAJointIsOfNoPointsBeyondIt) {
  auto map = std::make_shared<track::Map>(*junction());
  map->balise_groups[1].offset_m = 100;
  tracker = BaliseTracker(map, 5000);
  run(3, 80, 150, 2, true);  // nobody knows by which track it came
  run(3, 152, 170, 2, false);
  EXPECT_FALSE(tracker.reference());
}

TEST_F(LeftLeg, RoundARingAGroupHasNotItselfBefore) {
  auto map = std::make_shared<track::Map>();
  map->edges = {{1, "ring", 1, 1, "", track::Alignment::chained({0, 0, 0}, {{1000, 0.006283, 0.006283}})}};
  map->connections = {{1, 1, 1, false}};
  map->balise_groups = {{85, 1, 1, 100, true, true, 0, {}}};
  tracker = BaliseTracker(map, 5000);
  tracker.update(forward(1, 200), true);
  expect(kOfLoop[0], 100);
  EXPECT_EQ(previous(), 0U);
}

TEST(TakenBack, IsReportedWhereverGroupsAreNotReported) {
  for (const uint32_t m_loc : {0U, 1U, 2U}) {
    auto silent = settings();
    silent.parameters.t_cycloc = etcs::kNoCycleTime;
    silent.parameters.m_loc = m_loc;
    TprPublisher publisher(balise_map(), silent);
    double run_s = 0;
    double distance_m = 0;
    const auto run = [&](const track::EdgePosition& foot, double moved_m, bool declared) {
      auto position = at(foot, run_s += 0.2, 20);
      position.distance_m = distance_m += moved_m;
      position.track_probability = declared ? 1 : 0.5;
      return publisher.update(position, position.stamp_ns);
    };
    for (double m = 900; m < 1000; m += 4) run(forward(1, m), 4, true);
    for (double m = 2; m < 250; m += 4) run(forward(2, m), 4, false);
    for (double m = 250; m < 300; m += 4) run(forward(2, m), 4, true);
    Onboard asks;
    asks.m_level = 3;
    asks.stamp_ns = kStart + core::to_ns(run_s);
    asks.reports_wanted = 1;
    ASSERT_TRUE(publisher.set_onboard(asks, asks.stamp_ns).ok());
    const auto declared = run(forward(2, 302), 4, true);
    ASSERT_TRUE(declared.report) << m_loc;
    EXPECT_EQ(declared.report->fields.nid_lrbg, kD);
    const auto taken_back = run(forward(2, 306), 4, false);
    ASSERT_TRUE(taken_back.report) << m_loc;
    EXPECT_EQ(taken_back.report->fields.nid_lrbg, kC);
  }
}

TEST(DirectionOfMovement, IsNotThatOfACorrectionAtRest) {
  TprPublisher publisher(balise_map(), settings());
  double run_s = 0;
  uint32_t said = 99;
  const auto run = [&](double offset_m, double speed_mps, bool standstill) {
    auto position = at(forward(1, offset_m), run_s += 0.2, speed_mps);
    position.standstill = standstill;
    if (const auto outcome = publisher.update(position, position.stamp_ns); outcome.report)
      said = outcome.report->fields.q_dirtrain;
  };
  for (double m = 200; m < 240; m += 0.4) run(m, 2, false);
  for (int i = 0; i < 10; ++i) run(240, 0.001, true);
  for (int i = 0; i < 60; ++i) run(239.9, -0.001, true);
  EXPECT_EQ(said, etcs::kNominal);
}

// Slower than surely moving, and no second of rest between.
TEST(DirectionOfMovement, IsThatOfARollBackWithoutARest) {
  TprPublisher publisher(balise_map(), settings());
  double run_s = 0;
  double offset_m = 920;
  uint32_t said = 99;
  const auto run = [&](double speed_mps) {
    auto position = at(forward(1, offset_m += 0.2 * speed_mps), run_s += 0.2, speed_mps);
    position.distance_m = offset_m;
    if (const auto outcome = publisher.update(position, position.stamp_ns); outcome.report)
      said = outcome.report->fields.q_dirtrain;
  };
  for (int i = 0; i < 40; ++i) run(0.5);
  EXPECT_EQ(said, etcs::kNominal);
  for (int i = 0; i < 60; ++i) run(-0.5);
  EXPECT_EQ(said, etcs::kReverse);
}

}  // namespace
}  // namespace railfix::tpr_publisher
