#include "map_matcher/followed_path.hpp"

#include <gtest/gtest.h>

#include "core/time.hpp"
#include "core/units.hpp"

namespace railfix::map_matcher {
namespace {

using track::Alignment;
using track::Direction;
using track::EdgePosition;
using track::Map;
using Way = FollowedPath::Way;

constexpr double kRadiusM = 100;
constexpr double kLoopM = 7.0 / 3.0 * core::kPi * kRadiusM;

FollowedPath followed_on(const Map& map) {
  auto shared = std::make_shared<const Map>(map);
  auto ways = std::make_shared<const track::Ways>(*shared);
  return {std::move(shared), std::move(ways)};
}

PlacedTrain train_at(const EdgePosition& place) {
  return {core::to_ns(1000), place, 20, 5000, 3, 4};
}

Map line(double length_m) {
  Map map;
  map.edges = {{1, "line", 1, 2, "", Alignment::chained({}, {{length_m, 0, 0}})}};
  return map;
}

/// 1 km to a loop that leads back onto it.
Map balloon() {
  const double curve = 1 / kRadiusM;
  const double arc_m = core::kPi / 3 * kRadiusM;
  Map map = line(1000);
  map.edges.push_back(
      {2, "loop", 2, 2, "",
       Alignment::chained(map.edges[0].alignment.at(1000).pose,
                          {{arc_m, curve, curve}, {5 * arc_m, -curve, -curve}, {arc_m, curve, curve}})});
  map.connections = {{2, 1, 2, false}};
  return map;
}

/// 1 km to a switch: 800 m straight on, or 500 m to the left.
Map branch() {
  Map map = line(1000);
  const track::PlanPose at_switch = map.edges[0].alignment.at(1000).pose;
  map.edges.push_back({2, "on", 2, 3, "", Alignment::chained(at_switch, {{800, 0, 0}})});
  map.edges.push_back({3, "siding", 2, 4, "", Alignment::chained(at_switch, {{500, 0.003, 0.003}})});
  map.connections = {{2, 1, 2, false}, {2, 1, 3, true}};
  return map;
}

Way follow(FollowedPath& followed, const EdgePosition& place) {
  return core::value_or_throw(followed.follow(train_at(place)));
}
double place_of(const FollowedPath& followed, const EdgePosition& place) {
  const PlacedTrain train = train_at(place);
  return followed.prior_at(train.stamp_ns, train).value().path_distance_m;
}

TEST(FollowedPath, TheWindowIsExtrapolatedFromAStateThatIsNotOld) {
  FollowedPath followed = followed_on(line(2000));
  PlacedTrain train = train_at({1, 500, Direction::forward});
  EXPECT_FALSE(followed.prior_at(train.stamp_ns, train)) << "nothing is followed yet";
  EXPECT_EQ(follow(followed, {1, 450, Direction::forward}), Way::anew);
  EXPECT_EQ(follow(followed, train.place), Way::same);
  const Prior prior = followed.prior_at(train.stamp_ns + core::to_ns(0.5), train).value();
  EXPECT_NEAR(prior.path_distance_m, 60, 1e-9);
  EXPECT_NEAR(prior.travelled_m, 5010, 1e-9);
  EXPECT_EQ(prior.over_m, 3);
  EXPECT_EQ(prior.under_m, 4);
  EXPECT_FALSE(followed.prior_at(train.stamp_ns + core::to_ns(2.1), train));
  EXPECT_FALSE(followed.prior_at(train.stamp_ns - core::to_ns(2.1), train));
  train.speed_mps = NAN;
  EXPECT_NEAR(followed.prior_at(train.stamp_ns + core::to_ns(0.5), train).value().path_distance_m, 50, 1e-9);
  train.under_m = INFINITY;
  EXPECT_FALSE(followed.prior_at(train.stamp_ns, train)) << "nobody can search that";
}

TEST(FollowedPath, RoundALoopTheTrainIsOnThePassThatItRuns) {
  FollowedPath followed = followed_on(balloon());
  EXPECT_EQ(follow(followed, {1, 900, Direction::forward}), Way::anew);
  for (double offset_m = 950; offset_m < 1000; offset_m += 10)
    EXPECT_EQ(follow(followed, {1, offset_m, Direction::forward}), Way::same);
  for (double offset_m = 10; offset_m < kLoopM; offset_m += 10)
    EXPECT_EQ(follow(followed, {2, offset_m, Direction::forward}), Way::same);
  for (double offset_m = 990; offset_m > 300; offset_m -= 10) {
    const EdgePosition back{1, offset_m, Direction::reverse};
    EXPECT_EQ(follow(followed, back), Way::same);
    EXPECT_NEAR(place_of(followed, back), 100 + kLoopM + 1000 - offset_m, 1e-6);
  }
}

TEST(FollowedPath, DistancesGoOnOverATrackThatFusionTakesInstead) {
  FollowedPath followed = followed_on(branch());
  follow(followed, {1, 900, Direction::forward});
  EXPECT_EQ(follow(followed, {2, 50, Direction::forward}), Way::same) << "the straight way is expected";
  const EdgePosition siding{3, 60, Direction::forward};
  EXPECT_EQ(follow(followed, siding), Way::other_path);
  EXPECT_NEAR(place_of(followed, siding), 160, 1e-9);
  EXPECT_NEAR(place_of(followed, {1, 950, Direction::forward}), 50, 1e-9);
  EXPECT_EQ(follow(followed, {3, 70, Direction::forward}), Way::same);
}

TEST(FollowedPath, ATurnedTrainBeginsAnotherTrip) {
  FollowedPath followed = followed_on(branch());
  follow(followed, {1, 400, Direction::forward});
  follow(followed, {1, 500, Direction::forward});
  const EdgePosition turned{1, 500, Direction::reverse};
  EXPECT_FALSE(followed.prior_at(core::to_ns(1000), train_at(turned))) << "not on this path";
  EXPECT_EQ(follow(followed, turned), Way::anew);
  EXPECT_NEAR(place_of(followed, turned), 0, 1e-9);
}

TEST(FollowedPath, IsFollowedOnBeforeItsEndIsReached) {
  FollowedPath followed = followed_on(line(50000));
  follow(followed, {1, 10000, Direction::forward});
  const auto first = followed.path();
  EXPECT_EQ(follow(followed, {1, 36900, Direction::forward}), Way::same);
  EXPECT_EQ(followed.path(), first);
  EXPECT_EQ(follow(followed, {1, 37100, Direction::forward}), Way::other_path);
  EXPECT_NEAR(followed.path()->end_m(), 40000, 1e-9);
  EXPECT_NEAR(place_of(followed, {1, 37100, Direction::forward}), 27100, 1e-9);
  // Where the track itself ends nothing is gained by it.
  EXPECT_EQ(follow(followed, {1, 49000, Direction::forward}), Way::same);
}

TEST(FollowedPath, ATrainThatSetsBackFarKeepsItsDistances) {
  FollowedPath followed = followed_on(line(50000));
  follow(followed, {1, 20000, Direction::forward});
  EXPECT_NEAR(followed.path()->begin_m(), -5000, 1e-9);
  EXPECT_EQ(follow(followed, {1, 17900, Direction::forward}), Way::other_path);
  EXPECT_NEAR(followed.path()->begin_m(), -20000, 1e-9) << "whole edges are followed";
  EXPECT_NEAR(place_of(followed, {1, 17900, Direction::forward}), -2100, 1e-9);
}

TEST(FollowedPath, APlaceThatIsNotOnTheMapIsAnError) {
  FollowedPath followed = followed_on(line(1000));
  EXPECT_FALSE(followed.follow(train_at({7, 10, Direction::forward})).ok());
  EXPECT_EQ(followed.path(), nullptr);
  follow(followed, {1, 10, Direction::forward});
  EXPECT_FALSE(followed.follow(train_at({1, 1001, Direction::forward})).ok());
  EXPECT_NEAR(place_of(followed, {1, 20, Direction::forward}), 10, 1e-9) << "the path is still the one before";
}

}  // namespace
}  // namespace railfix::map_matcher
