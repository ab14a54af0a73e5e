#include "fusion/turned_way.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace railfix::fusion {
namespace {

constexpr double kPointsM = 500;
constexpr double kSigmaRad = 0.004;
constexpr TurnedWay::Errors kErrors{1e-4, 0.3};

/// Straight on, or behind the points to the left on a turnout of this radius that is 35 m long.
track::Path leg(double radius_m) {
  auto map = std::make_shared<track::Map>();
  const double curvature = std::isfinite(radius_m) ? 1 / radius_m : 0;
  map->edges.push_back(
      {1, "leg", 1, 2, "",
       track::Alignment::chained({0, 0, 0}, {{kPointsM, 0, 0}, {35, curvature, curvature}, {1000, 0, 0}})});
  return core::value_or_throw(track::Path::follow(map, {1, 0, track::Direction::forward}, 1500, 0));
}

/// What a perfect gyro feels in a body that turns so far behind the foot; backwards where the speed is negative.
void ride(TurnedWay& way, const track::Path& path, double from_m, double to_m, double speed_mps, double behind_m) {
  const auto heading_rad = [&](double m) { return path.at(m - behind_m).pose.heading_rad; };
  for (double m = from_m; (to_m - m) * speed_mps > 0; m += speed_mps)
    way.add({m, m + speed_mps, heading_rad(m) - heading_rad(m + speed_mps), kSigmaRad, 1});
}
TurnedWay ridden(const track::Path& path, double from_m, double to_m, double speed_mps, double behind_m) {
  TurnedWay way;
  ride(way, path, from_m, to_m, speed_mps, behind_m);
  return way;
}

TEST(TurnedWay, FitsTheLegThatWasTakenWhereverTheBogiesAreAndNoOther) {
  const auto straight = leg(INFINITY);
  for (const double radius_m : {190.0, 300.0, 500.0}) {
    const auto turnout = leg(radius_m);
    for (const double behind_m : {0.0, 5.0, 13.0, 20.0}) {
      const auto way = ridden(turnout, kPointsM - 60, kPointsM + 70, 11, behind_m);
      EXPECT_LT(way.misfit(turnout, kErrors).most, 3) << radius_m << " m, " << behind_m << " m";
      EXPECT_GT(way.misfit(straight, kErrors).most, 4) << radius_m << " m, " << behind_m << " m";
    }
    const auto on = ridden(straight, kPointsM - 60, kPointsM + 70, 11, 0);
    EXPECT_LT(on.misfit(straight, kErrors).most, 0.01);
    EXPECT_GT(on.misfit(turnout, kErrors).most, 4) << radius_m;
  }
}

TEST(TurnedWay, OfATrainThatBacksIsTheSameTheOtherWay) {
  const auto turnout = leg(300);
  const auto back = ridden(turnout, kPointsM + 70, kPointsM - 60, -8, 10);
  EXPECT_LT(back.misfit(turnout, kErrors).most, 3);
  EXPECT_GT(back.misfit(leg(INFINITY), kErrors).most, 4);
}

TEST(TurnedWay, BeginsAnewWhereThePlaceJumps) {
  const auto turnout = leg(300);
  auto way = ridden(turnout, kPointsM - 60, kPointsM + 70, 11, 0);
  EXPECT_GT(way.misfit(leg(INFINITY), kErrors).most, 4);
  way.add({kPointsM + 200, kPointsM + 211, 0, kSigmaRad, 1});
  EXPECT_LT(way.misfit(leg(INFINITY), kErrors).most, 0.01);
}

// Over the points, back, and on over the other leg: what was felt on the first says nothing of the second.
TEST(TurnedWay, BeginsAnewWhereTheTrainBacks) {
  const auto straight = leg(INFINITY);
  const auto turnout = leg(190);
  auto way = ridden(straight, kPointsM - 20, kPointsM + 20, 3, 0);
  ride(way, straight, kPointsM + 20, kPointsM - 6, -3, 0);
  ride(way, turnout, kPointsM - 7, kPointsM + 10, 3, 0);
  EXPECT_LT(way.misfit(turnout, kErrors).most, 3);
}

TEST(TurnedWay, HoldsTheLastTwelveSecondsOfTheWayInEitherDirection) {
  const auto straight = leg(INFINITY);
  EXPECT_FALSE(TurnedWay{}.holds(0));
  const auto way = ridden(straight, 0, 300, 10, 0);
  EXPECT_TRUE(way.holds(181) && way.holds(300));
  EXPECT_FALSE(way.holds(179) || way.holds(301));
  const auto back = ridden(straight, 300, 250, -10, 0);
  EXPECT_TRUE(back.holds(251) && back.holds(300));
  EXPECT_FALSE(back.holds(249));
}

TEST(TurnedWay, ABumpIsOneWorstPiece) {
  const auto straight = leg(INFINITY);
  auto way = ridden(straight, 0, 100, 20, 0);
  way.add({100, 120, 0.05, kSigmaRad, 1});
  const auto misfit = way.misfit(straight, kErrors);
  EXPECT_GT(misfit.most, 4);
  EXPECT_LT(misfit.without_worst, 1);
}

TEST(TurnedWay, ATurnOfTheTrackThatWasNotFeltIsNoBump) {
  const auto on = ridden(leg(INFINITY), kPointsM - 120, kPointsM + 120, 40, 0);  // over the points within a second
  const auto misfit = on.misfit(leg(190), kErrors);
  EXPECT_GT(misfit.most, 4);
  EXPECT_EQ(misfit.without_worst, misfit.most);
}

// An S over a crossover turns by nothing in all: it must not become one piece.
TEST(TurnedWay, ATrainThatCreepsFeelsACrossover) {
  auto map = std::make_shared<track::Map>();
  map->edges.push_back({1, "leg", 1, 2, "",
                        track::Alignment::chained(
                            {0, 0, 0}, {{kPointsM, 0, 0}, {25, 0.005, 0.005}, {25, -0.005, -0.005}, {500, 0, 0}})});
  const auto crossover = core::value_or_throw(track::Path::follow(map, {1, 0, track::Direction::forward}, 1000, 0));
  TurnedWay way;
  for (double m = kPointsM - 20; m < kPointsM + 70; m += 0.4) {
    const double turn_rad = crossover.at(m).pose.heading_rad - crossover.at(m + 0.4).pose.heading_rad;
    way.add({m, m + 0.4, turn_rad, 1e-4, 1});
  }
  EXPECT_TRUE(way.holds(kPointsM));
  EXPECT_LT(way.misfit(crossover, {1e-5, 0.3}).most, 3);
  EXPECT_GT(way.misfit(leg(INFINITY), {1e-5, 0.3}).most, 4);
}

TEST(TurnedWay, AHaltIsNoWayBack) {
  auto way = ridden(leg(190), kPointsM - 60, kPointsM + 70, 11, 0);
  const double here_m = kPointsM + 72;
  for (int second = 0; second < 20; ++second) {
    const double jitter_m = second % 2 == 0 ? -0.1 : 0.1;
    way.add({here_m, here_m + jitter_m, 0, kSigmaRad, 1});
  }
  EXPECT_TRUE(way.holds(kPointsM));
  EXPECT_LT(way.misfit(leg(190), kErrors).most, 3);
  EXPECT_GT(way.misfit(leg(INFINITY), kErrors).most, 4);
}

TEST(TurnedWay, ATrainAtWalkingPaceStillRemembersThePoints) {
  const auto way = ridden(leg(500), kPointsM - 20, kPointsM + 80, 1.5, 0);
  EXPECT_TRUE(way.holds(kPointsM));
  EXPECT_LT(way.misfit(leg(500), kErrors).most, 3);
  EXPECT_GT(way.misfit(leg(INFINITY), kErrors).without_worst, 2);
}

TEST(TurnedWay, PointsThatAreDrawnTenMetresElsewhereAreNoOtherLeg) {
  const auto mapped = leg(190);
  for (const double moved_m : {-10.0, 10.0}) {
    const auto way = ridden(mapped, kPointsM - 60, kPointsM + 70, 11, moved_m);
    EXPECT_LT(way.misfit(mapped, kErrors).most, 3) << moved_m;
    EXPECT_GT(way.misfit(leg(INFINITY), kErrors).most, 4) << moved_m;
  }
}

}  // namespace
}  // namespace railfix::fusion
