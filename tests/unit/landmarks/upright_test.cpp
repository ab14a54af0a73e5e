#include <gtest/gtest.h>

#include <cmath>

#include "track_detector/platform_tracker.hpp"
#include "track_detector/upright_objects.hpp"

namespace railfix::track_detector {
namespace {

constexpr double kStepM = 0.7;
constexpr double kWidest = 0.55;

/// An upright line beside straight track.
struct Corner {
  double place_m, lateral_m, inner_grey, outer_grey;
};

std::vector<UprightObject> pass(const std::vector<Corner>& corners, double to_m) {
  EdgeTracker tracker;
  UprightObjects objects;
  std::vector<UprightObject> told;
  LandmarkPicture picture;
  for (double way_m = 0; way_m < to_m; way_m += kStepM) {
    std::vector<UprightEdge> seen;
    for (const Corner& corner : corners) {
      const double ahead_m = corner.place_m - way_m;
      const double bearing = corner.lateral_m / ahead_m;
      if (ahead_m < 2 || ahead_m > 25 || std::abs(bearing) > kWidest + 0.05) continue;
      seen.push_back({bearing, corner.inner_grey, corner.outer_grey, 100});
    }
    for (const auto& object : objects.add(tracker.follow(seen, picture, way_m, kWidest), way_m)) told.push_back(object);
  }
  return told;
}

TEST(Uprights, AMastStandsWhereItsEdgesComeFrom) {
  const auto told = pass({{40, 3.2, 100, 60}, {40, 3.46, 60, 100}}, 45);
  ASSERT_EQ(told.size(), 1U);
  EXPECT_EQ(told[0].type, LandmarkType::mast);
  EXPECT_NEAR(told[0].place_m, 40, 0.02);
  EXPECT_NEAR(told[0].lateral_m, 3.33, 0.02);
}

TEST(Uprights, AMastOfWhichOnlyTheSideShowsIsOne) {
  const auto told = pass({{40.13, -3.2, 100, 60}, {39.87, -3.2, 60, 100}}, 45);
  ASSERT_EQ(told.size(), 1U);
  EXPECT_NEAR(told[0].place_m, 40, 0.15);
}

TEST(Uprights, APostIsNoMast) {
  EXPECT_TRUE(pass({{40, 3.2, 100, 60}, {40, 3.32, 60, 100}}, 45).empty());
}

TEST(Uprights, ATunnelHasOnePortalInAndOneOut) {
  std::vector<Corner> corners = {{40, 2.7, 70, 120},    {40, -2.7, 70, 120},   {42.5, 2.7, 40, 70},
                                 {42.5, -2.7, 40, 70},  {70, 2.7, 150, 90},    {70, -2.7, 150, 90},
                                 {72.5, 2.7, 210, 170}, {72.5, -2.7, 210, 170}};
  EdgeTracker tracker;
  UprightObjects objects;
  std::vector<UprightObject> told;
  LandmarkPicture picture;
  for (double way_m = 0; way_m < 80; way_m += kStepM) {
    std::vector<UprightEdge> seen;
    for (const Corner& corner : corners) {
      const double ahead_m = corner.place_m - way_m;
      const double bearing = corner.lateral_m / ahead_m;
      if (ahead_m < 2 || ahead_m > 25 || std::abs(bearing) > kWidest + 0.05) continue;
      seen.push_back({bearing, corner.inner_grey, corner.outer_grey, corner.place_m < 60 ? 15.0 : 200.0});
    }
    for (const auto& object : objects.add(tracker.follow(seen, picture, way_m, kWidest), way_m)) told.push_back(object);
  }
  ASSERT_EQ(told.size(), 2U);
  EXPECT_EQ(told[0].type, LandmarkType::portal_in);
  EXPECT_NEAR(told[0].place_m, 40, 0.05);
  EXPECT_EQ(told[1].type, LandmarkType::portal_out);
  EXPECT_NEAR(told[1].place_m, 72.5, 0.05);
}

TEST(Uprights, WallsWithDaylightBehindAreABridge) {
  const auto told = pass({{40, 4.0, 80, 120}, {40, -4.0, 80, 120}, {49, 4.0, 100, 80}, {49, -4.0, 100, 80}}, 60);
  ASSERT_EQ(told.size(), 1U);
  EXPECT_EQ(told[0].type, LandmarkType::bridge);
  EXPECT_NEAR(told[0].place_m, 40, 0.05);
}

std::vector<SettledPlatform> approach(double height_m, double lateral_m) {
  constexpr double kEyeM = 2.5;
  const double factor = (kEyeM - kUsualPlatformM) / (kEyeM - height_m);
  PlatformTracker tracker;
  std::vector<SettledPlatform> told;
  for (double way_m = 0; way_m < 40; way_m += kStepM) {
    const double ahead_m = factor * (30 - way_m);
    std::vector<PlatformMark> seen;
    if (ahead_m > 4.5 && ahead_m < 19) seen.push_back({-1, true, ahead_m, factor * lateral_m, 0.9});
    for (const auto& end : tracker.follow(seen, way_m)) told.push_back(end);
  }
  return told;
}

TEST(Platforms, HeightFollowsFromTheMotion) {
  for (const double height_m : {0.38, 0.55, 0.76}) {
    const auto told = approach(height_m, 1.67);
    ASSERT_EQ(told.size(), 1U) << height_m;
    EXPECT_NEAR(told[0].place_m, 30, 0.1);
    EXPECT_LT(std::abs(told[0].place_m - 30), 2 * told[0].sigma_m);
    EXPECT_NEAR(told[0].lateral_m, -1.67, 0.05);
  }
}

TEST(Platforms, WhatLiesOnTheGroundIsNone) {
  EXPECT_TRUE(approach(-0.1, 2.2).empty());
}

}  // namespace
}  // namespace railfix::track_detector
