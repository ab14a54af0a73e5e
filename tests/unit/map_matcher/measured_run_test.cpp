#include "map_matcher/locate/measured_run.hpp"

#include <gtest/gtest.h>

namespace railfix::map_matcher::measured_run_test {
namespace {

constexpr double kCurvaturePerM = 1 / 400.0;
constexpr double kStepM = 0.5;

void run(MeasuredRun& run, double way_m, double curvature_per_m = kCurvaturePerM) {
  const double step_m = way_m < 0 ? -kStepM : kStepM;
  const auto steps = static_cast<int>(std::lround(way_m / step_m));
  for (int i = 0; i < steps; ++i) run.move(step_m, curvature_per_m * step_m, 1e-4);
}

double turned(const MeasuredRun& run) {
  double sum = 0;
  for (const auto& bin : run.way()) sum += bin.turn_rad;
  return sum;
}

TEST(MeasuredRun, WhatWasGoneOverTwiceCountsOnce) {
  MeasuredRun ahead({}, MeasuredRun::Direction::ahead);
  run(ahead, 605);
  EXPECT_EQ(ahead.bins(), 30U);
  run(ahead, -250);
  EXPECT_EQ(ahead.bins(), 17U);
  EXPECT_FALSE(ahead.at_front());
  run(ahead, 250);
  EXPECT_TRUE(ahead.at_front());
  EXPECT_EQ(ahead.bins(), 30U);
  EXPECT_NEAR(turned(ahead), 600 * kCurvaturePerM, 1e-6);
}

TEST(MeasuredRun, AsternItIsTheWayOfATrainTurnedRound) {
  MeasuredRun astern({}, MeasuredRun::Direction::astern);
  run(astern, 300);
  EXPECT_EQ(astern.bins(), 0U);
  EXPECT_TRUE(astern.at_front());
  run(astern, -605);
  EXPECT_EQ(astern.bins(), 30U);
  EXPECT_NEAR(turned(astern), -600 * kCurvaturePerM, 1e-6);
  EXPECT_NEAR(astern.open_m(), 5 - LocatorParameters{}.lag_m, 1e-6);
}

TEST(MeasuredRun, BackTooFarItBeginsAnew) {
  MeasuredRun ahead({}, MeasuredRun::Direction::ahead);
  run(ahead, 3000);
  run(ahead, -520);
  EXPECT_EQ(ahead.bins(), 0U);
  EXPECT_TRUE(ahead.at_front());
}

TEST(MeasuredRun, BackOnAnotherLegItBeginsAnew) {
  MeasuredRun ahead({}, MeasuredRun::Direction::ahead);
  run(ahead, 600);
  run(ahead, -100, kCurvaturePerM + 1 / 500.0);
  EXPECT_EQ(ahead.bins(), 0U);
}

TEST(MeasuredRun, ALandmarkSightedAgainBehindAHaltCountsOnce) {
  MeasuredRun ahead({}, MeasuredRun::Direction::ahead);
  const auto marks = [&] {
    size_t count = 0;
    for (const auto& bin : ahead.way()) count += bin.marks.size();
    return count;
  };
  const auto sight = [&](double distance_m) {
    ahead.sight({0, track::LandmarkKind::balise, distance_m, 0, 0.1, 0.95});
  };
  run(ahead, 200);
  sight(8);
  run(ahead, -0.5);
  run(ahead, 0.5);
  sight(8.2);
  run(ahead, 100);
  EXPECT_EQ(marks(), 1U);
  // What is gone back behind is sighted anew.
  run(ahead, -150);
  EXPECT_EQ(marks(), 0U);
  run(ahead, 50);
  sight(8);
  run(ahead, 100);
  EXPECT_EQ(marks(), 1U);
}

TEST(MeasuredRun, AsternALandmarkInFrontLiesOnTheWayBehind) {
  MeasuredRun astern({}, MeasuredRun::Direction::astern);
  run(astern, -605);
  astern.sight({0, track::LandmarkKind::frog, 45, 0.7, 0.1, 0.95});
  const double at_m = 605 - LocatorParameters{}.lag_m - 45;
  const auto way = astern.way();
  const auto& marks = way.at(static_cast<size_t>(at_m / kBinM)).marks;
  ASSERT_EQ(marks.size(), 1U);
  EXPECT_NEAR(marks[0].along_m, std::fmod(at_m, kBinM), 1e-6);
  EXPECT_EQ(marks[0].lateral_m, -0.7);
}

}  // namespace
}  // namespace railfix::map_matcher::measured_run_test
