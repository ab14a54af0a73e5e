#include "map/coverage.hpp"

#include <gtest/gtest.h>

#include "core/units.hpp"
#include "unit/track/small_map.hpp"

namespace railfix::tool {
namespace {

using track::Direction;

/// The small map's main line: 1800 m, one group at 900 m with Q_LOCACC 5 m.
track::Path main_line(Direction direction = Direction::forward) {
  const auto map = std::make_shared<const track::Map>(track::small_map());
  const bool forward = direction == Direction::forward;
  return core::value_or_throw(track::Path::follow(map, {forward ? 1U : 2U, forward ? 0.0 : 800.0, direction}, 5000, 0));
}

TEST(Coverage, SaysWhereTheIntervalOutgrowsTheLimit) {
  // 1 % of the way on top of 5 m: 10 m after 500 m.
  const CoverageOptions options{.scale_sigma = 0.0025, .sigmas = 4, .limit_m = 10, .virtual_locacc_m = 5};
  const Coverage found = coverage_of(main_line(), options);
  EXPECT_EQ(found.references, 1U);
  ASSERT_EQ(found.gaps.size(), 2U);
  EXPECT_NEAR(found.gaps[0].from_m, 500, 1e-9);
  EXPECT_NEAR(found.gaps[0].to_m, 900, 1e-9);
  EXPECT_NEAR(found.gaps[0].largest_m, 14, 1e-9);
  EXPECT_FALSE(found.gaps[0].outside_budget);
  ASSERT_EQ(found.gaps[0].references_m.size(), 1U);
  EXPECT_NEAR(found.gaps[0].references_m[0], 500, 1e-9);
  EXPECT_NEAR(found.gaps[1].from_m, 1400, 1e-6);
  EXPECT_NEAR(found.covered_m, 1000, 1e-6);
}

TEST(Coverage, IsOtherTheOtherWay) {
  const CoverageOptions options{.scale_sigma = 0.0025, .sigmas = 4, .limit_m = 10, .virtual_locacc_m = 5};
  const Coverage found = coverage_of(main_line(Direction::reverse), options);
  ASSERT_EQ(found.gaps.size(), 2U);
  EXPECT_NEAR(found.gaps[0].to_m, 900, 1e-6);  // 800 + 100 back to the group

  // The same way run backwards, in its own distances.
  const track::Path there = main_line();
  const Coverage back = coverage_of(there, options, true);
  ASSERT_EQ(back.gaps.size(), 2U);
  EXPECT_NEAR(back.covered_m, found.covered_m, 1e-6);
  for (size_t i = 0; i < 2; ++i) {
    EXPECT_NEAR(back.gaps[i].from_m, there.end_m() - found.gaps[i].from_m, 1e-6);
    EXPECT_NEAR(back.gaps[i].to_m, there.end_m() - found.gaps[i].to_m, 1e-6);
    EXPECT_NEAR(back.gaps[i].references_m[0], there.end_m() - found.gaps[i].references_m[0], 1e-6);
  }
}

TEST(Coverage, GoodOdometryNeedsNoMore) {
  EXPECT_TRUE(coverage_of(main_line(), {.scale_sigma = 0.0005, .sigmas = 4.5, .limit_m = 10}).gaps.empty());
}

TEST(Coverage, TellsWhatIsBeyondTheBudgetAndWhatNothingHelps) {
  const Coverage found =
      coverage_of(main_line(), {.scale_sigma = 0.02, .sigmas = 4, .limit_m = 4, .virtual_locacc_m = 5});
  ASSERT_FALSE(found.gaps.empty());
  EXPECT_TRUE(found.gaps[0].outside_budget);
  EXPECT_TRUE(found.gaps[0].references_m.empty());
}

TEST(Coverage, NaturalReferencesCountWhereAskedFor) {
  CoverageOptions options{.scale_sigma = 0.0025, .sigmas = 4, .limit_m = 10, .virtual_locacc_m = 5, .natural = true};
  const Coverage found = coverage_of(main_line(), options);
  EXPECT_EQ(found.references, 2U);  // the mast at 300 m
  EXPECT_NEAR(found.gaps[0].from_m, 900 + (10 - 5) / 0.01, 1e-6);
}

/// A mast every 50 m on the first 1000 m, so roughly known that none brings the train under 12 m.
track::Path line_of_rough_masts() {
  auto map = std::make_shared<track::Map>(track::small_map());
  map->balise_groups.clear();
  map->landmarks.clear();
  for (uint32_t id = 1; id <= 20; ++id)
    map->landmarks.push_back({id, track::LandmarkKind::mast, 1, 50.0 * id - 25, -3, 3, "mast"});
  return core::value_or_throw(track::Path::follow(map, {1, 0, Direction::forward}, 5000, 0));
}

TEST(Coverage, CountsEveryMetreOnceHoweverManyReferencesDoNotHelp) {
  const track::Path path = line_of_rough_masts();
  CoverageOptions options{.scale_sigma = 0.01, .sigmas = 4.5, .limit_m = 12, .virtual_locacc_m = 5, .natural = true};
  for (const bool backwards : {false, true}) {
    const Coverage found = coverage_of(path, options, backwards);
    EXPECT_NEAR(found.covered_m, 7 / 0.045, 1e-6);  // masts of 13.5 m, each of which helps a train that knows less
    ASSERT_EQ(found.gaps.size(), 1U);
    EXPECT_NEAR(std::abs(found.gaps[0].to_m - found.gaps[0].from_m), 1800 - 7 / 0.045, 1e-6);
    EXPECT_EQ(found.gaps[0].references_m.size(), 11U);  // every 155.6 m of it
    EXPECT_NEAR(std::abs(found.gaps[0].references_m[1] - found.gaps[0].references_m[0]), 7 / 0.045, 1e-6);
  }
  options.limit_m = 30;
  const Coverage all = coverage_of(path, options);
  EXPECT_LE(all.covered_m, path.end_m());
  EXPECT_NEAR(all.covered_m + (all.gaps.empty() ? 0 : all.gaps[0].to_m - all.gaps[0].from_m), path.end_m(), 1e-6);
}

TEST(Coverage, ARingIsOneLap) {
  track::Map map;
  const double around_m = 2 * core::kPi * 500;
  map.nodes.push_back({1, track::NodeKind::joint, "", 0, 0});
  map.edges.push_back({1, "ring", 1, 1, "", track::Alignment::chained({0, 0, 0}, {{around_m, 0.002, 0.002}})});
  map.connections.push_back({1, 1, 1, false});
  const auto ring = std::make_shared<const track::Map>(std::move(map));
  for (const double start_m : {0.0, 1000.0}) {
    const auto way = core::value_or_throw(way_from(ring, {1, start_m, Direction::forward}, 1e7));
    EXPECT_NEAR(way.end_m() - way.begin_m(), around_m, 1e-6) << start_m;
  }
  EXPECT_NEAR(core::value_or_throw(way_from(ring, {1, 0, Direction::forward}, 700)).end_m(), 700, 1e-9);
  EXPECT_NEAR(core::value_or_throw(way_from(ring, {1, 3000, Direction::forward}, 700)).end_m(), 700, 1e-9);
}

TEST(Coverage, AWayHasALength) {
  const auto map = std::make_shared<const track::Map>(track::small_map());
  EXPECT_NEAR(core::value_or_throw(way_from(map, {1, 0, Direction::forward}, 500)).end_m(), 500, 1e-9);
  for (const double length_m : {0.0, -5.0, std::nan("")})
    EXPECT_FALSE(way_from(map, {1, 0, Direction::forward}, length_m).ok()) << length_m;
}

TEST(Coverage, WhatNobodySightsIsNoReference) {
  auto map = std::make_shared<track::Map>(track::small_map());
  map->landmarks.push_back({4, track::LandmarkKind::underbridge, 1, 500, 0, 3, "viaduct"});
  map->landmarks.push_back({5, track::LandmarkKind::level_crossing, 1, 600, 0, 3, "lane"});
  const auto path = core::value_or_throw(track::Path::follow(map, {1, 0, Direction::forward}, 5000, 0));
  EXPECT_EQ(coverage_of(path, {.natural = true}).references, 2U);
  map->landmarks[3].kind = track::LandmarkKind::bridge;
  const auto over = core::value_or_throw(track::Path::follow(map, {1, 0, Direction::forward}, 5000, 0));
  EXPECT_EQ(coverage_of(over, {.natural = true}).references, 3U);
}

}  // namespace
}  // namespace railfix::tool
