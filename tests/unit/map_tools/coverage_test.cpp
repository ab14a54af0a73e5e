#include "map/coverage.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/units.hpp"
#include "map/group_gaps.hpp"
#include "track/import/finish.hpp"
#include "unit/track/small_map.hpp"

namespace railfix::tool {
namespace {

using track::Direction;

/// 1800 m with a balise at 900 m, a mast at 300 m and a group for the balise.
track::Path main_line(const track::Map& map) {
  return core::value_or_throw(
      track::Path::follow(std::make_shared<const track::Map>(map), {1, 0, track::Direction::forward}, 5000, 0));
}
track::Path main_line() {
  return main_line(track::small_map());
}

/// A straight line of 1500 m with these landmarks.
constexpr double kLineM = 1500;
track::Path line_with(std::vector<track::Landmark> landmarks) {
  track::Map map;
  map.nodes = {{1, track::NodeKind::end, "", 0, 0}, {2, track::NodeKind::end, "", 0, kLineM}};
  map.edges.push_back({1, "line", 1, 2, "", track::Alignment::chained({0, 0, 0}, {{kLineM, 0, 0}})});
  map.landmarks = std::move(landmarks);
  return main_line(map);
}
track::Landmark frog_at(double offset_m) {
  return {static_cast<uint32_t>(offset_m), track::LandmarkKind::frog, 1, offset_m, 0.7, 0.1, "frog"};
}

double half_at(const std::vector<PromisedPlace>& promised, double at_m) {
  for (const PromisedPlace& place : promised) {
    if (place.at_m >= at_m) return place.half_m;
  }
  return std::nan("");
}
double largest(const std::vector<PromisedPlace>& promised) {
  double largest_m = 0;
  for (const PromisedPlace& place : promised) largest_m = std::max(largest_m, place.half_m);
  return largest_m;
}

TEST(Coverage, AVirtualGroupIsOnlyAName) {
  track::Map map = track::small_map();
  const auto without = promised_on(main_line(map), {});
  for (uint32_t i = 0; i < 8; ++i) map.balise_groups.push_back({85, 200 + i, 1, 100.0 + 100 * i, true, true, 1, {}});
  const track::Path named = main_line(map);
  const auto with = promised_on(named, {});
  EXPECT_EQ(references_on(named, {}).virtual_groups, 8U);
  ASSERT_EQ(with.size(), without.size());
  for (size_t i = 0; i < with.size(); ++i) ASSERT_EQ(with[i].half_m, without[i].half_m) << with[i].at_m;
}

TEST(Coverage, CountsWhatTheCameraSights) {
  track::Map map = track::small_map();
  map.landmarks.push_back({4, track::LandmarkKind::underbridge, 1, 500, 0, 3, "viaduct"});
  map.landmarks.push_back({5, track::LandmarkKind::level_crossing, 1, 600, 0, 3, "lane"});
  const track::Path path = main_line(map);
  const References all = references_on(path, {});
  EXPECT_EQ(all.counted,
            (std::map<track::LandmarkKind, size_t>{{track::LandmarkKind::balise, 1}, {track::LandmarkKind::mast, 1}}));
  EXPECT_EQ(all.unsighted_groups, 0U);
  CoverageOptions masts;
  masts.sighted = {track::LandmarkKind::mast};
  EXPECT_EQ(references_on(path, masts).counted.size(), 1U);
  EXPECT_EQ(references_on(path, masts).unsighted_groups, 1U);
  const auto frogs = {frog_at(300), frog_at(600), frog_at(700)};
  EXPECT_EQ(largest(promised_on(line_with(frogs), masts)), largest(promised_on(line_with({}), {})));
}

TEST(Coverage, OneLandmarkAloneIsHardlyBelieved) {
  const auto none = promised_on(line_with({}), {});
  const auto one = promised_on(line_with({frog_at(600)}), {});
  const auto three = promised_on(line_with({frog_at(600), frog_at(800), frog_at(1000)}), {});
  EXPECT_NEAR(half_at(one, 550), half_at(none, 550), 0.01);
  EXPECT_GT(half_at(one, 1100), 0.7 * half_at(none, 1100));  // the place without it is held, too
  EXPECT_LT(half_at(three, 1100), 0.3 * half_at(none, 1100));
}

TEST(Coverage, GapsAndWhatIsCoveredAreTheWholeWay) {
  CoverageOptions options;
  options.limit_m = 20;
  const BothWays found = coverage_of(main_line(), options).now;
  for (const bool backwards : {false, true}) {
    const Extent& extent = backwards ? found.back : found.there;
    double gaps_m = 0;
    for (const CoverageGap& gap : extent.gaps) {
      EXPECT_GT(gap.largest_m, 20);
      EXPECT_EQ(gap.to_m > gap.from_m, !backwards);
      gaps_m += std::abs(gap.to_m - gap.from_m);
    }
    EXPECT_GT(gaps_m, 100);
    EXPECT_NEAR(gaps_m + extent.covered_m, 1800, 1e-6);
  }
}

TEST(Coverage, IsTheSameForATrainThatMeetsTheSame) {
  CoverageOptions options;
  options.limit_m = 20;
  const Extent there = coverage_of(line_with({frog_at(300), frog_at(600), frog_at(700)}), options).now.there;
  const Extent back = coverage_of(line_with({frog_at(800), frog_at(900), frog_at(1200)}), options).now.back;
  EXPECT_NEAR(back.covered_m, there.covered_m, 1e-6);
  ASSERT_EQ(back.gaps.size(), there.gaps.size());
  for (size_t i = 0; i < there.gaps.size(); ++i) EXPECT_NEAR(back.gaps[i].from_m, kLineM - there.gaps[i].from_m, 1e-6);
}

// The start is told to no better, and by the first picture that is believed the interval is shorter.
TEST(Coverage, AStandingTrainIsNoGap) {
  CoverageOptions options;
  const auto promised = promised_on(line_with({}), options);
  const auto moving = std::ranges::find_if(promised, [](const PromisedPlace& place) { return place.at_m > 0; });
  ASSERT_GT(promised.front().half_m, moving->half_m);
  options.limit_m = 0.5 * (promised.front().half_m + moving->half_m);
  for (const CoverageGap& gap : coverage_of(line_with({}), options).now.there.gaps) EXPECT_GT(gap.to_m, gap.from_m);
}

TEST(Coverage, WhatItProposesHelpsBothWays) {
  const Coverage found = coverage_of(line_with({}), {});
  ASSERT_FALSE(found.markers_m.empty());
  EXPECT_LT(found.now.there.covered_m, 400);
  EXPECT_TRUE(found.with_markers.there.gaps.empty() && found.with_markers.back.gaps.empty());
  std::vector<track::Landmark> masts;
  for (const double at_m : found.markers_m)
    masts.push_back({static_cast<uint32_t>(masts.size() + 1), track::LandmarkKind::mast, 1, at_m, -3, 0.1, ""});
  for (const bool backwards : {false, true}) EXPECT_LE(largest(promised_on(line_with(masts), {}, backwards)), 10);
}

TEST(Coverage, NothingHelpsAgainstALimitThatFusionNeverPromises) {
  CoverageOptions options;
  options.limit_m = 0.4;
  const Coverage found = coverage_of(line_with({}), options);
  EXPECT_NEAR(found.now.there.covered_m, 0, 1e-6);
  EXPECT_TRUE(found.markers_m.empty());
}

TEST(Coverage, SaysWhereBaliseGroupsAreMissing) {
  CoverageOptions options;
  options.group_limit_m = 500;
  const auto missing = [&](const track::Path& path) {
    std::vector<double> out;
    for (const GroupGap& gap : group_gaps(path, options))
      out.insert(out.end(), gap.missing_m.begin(), gap.missing_m.end());
    return out;
  };
  EXPECT_EQ(missing(line_with({})), (std::vector<double>{375, 750, 1125})) << "a train at the end has one, too";
  EXPECT_EQ(missing(line_with({frog_at(200), frog_at(300), frog_at(450)})), (std::vector<double>{450, 800, 1150}))
      << "the last one that the train sights on the way there, the others evenly";
  track::Map map = track::small_map();  // a real group at 900 m of 1800
  map.balise_groups.push_back({85, 200, 2, 390, true, true, 1, {}});
  const auto gaps = group_gaps(main_line(map), options);
  ASSERT_EQ(gaps.size(), 1U);
  EXPECT_EQ(gaps[0].from_m, 0);
  EXPECT_NEAR(gaps[0].to_m, 900, 1e-6);
  EXPECT_EQ(gaps[0].missing_m, std::vector<double>{450}) << "at the mast, 300 m, one more would be needed";
  ASSERT_TRUE(track::add_virtual_balises_at(map, {"1:450"}, {{85}, 300}, 1).ok());
  EXPECT_TRUE(group_gaps(main_line(map), options).empty());
}

TEST(Coverage, GoesByFusionsParameters) {
  CoverageOptions options;
  options.fusion.visual_scale_sigma = options.fusion.wheel_scale_sigma = 0.002;
  EXPECT_LT(largest(promised_on(line_with({}), options)), 0.5 * largest(promised_on(line_with({}), {})));
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
  const auto nothing_ahead = way_from(map, {1, 0, Direction::reverse}, 1e7);
  ASSERT_FALSE(nothing_ahead.ok());
  EXPECT_THAT(nothing_ahead.error().message, testing::HasSubstr("the track ends where the way begins"));
}

}  // namespace
}  // namespace railfix::tool
