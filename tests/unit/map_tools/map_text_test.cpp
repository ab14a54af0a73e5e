#include "map/map_text.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "unit/track/small_map.hpp"

namespace railfix::tool {
namespace {

using testing::HasSubstr;

std::string printed(const std::function<void()>& print) {
  testing::internal::CaptureStdout();
  print();
  return testing::internal::GetCapturedStdout();
}

// 10 cm of cant over 1000 m; a clothoid for the rate of its curvature.
TEST(MapText, APlaceIsToldWhole) {
  track::Map map = track::small_map();
  const std::string text = printed([&] { print_place(map, {1, 500}, false); });
  EXPECT_THAT(text, HasSubstr("cant, twist      50.0 mm (right rail higher), 0.100 mm per m"));
  EXPECT_THAT(text, HasSubstr("its rate         0.000e+00 per m2"));
  EXPECT_THAT(text, HasSubstr("height, grade    "));
  EXPECT_THAT(text, HasSubstr("heading"));
  EXPECT_THAT(text, HasSubstr("latitude"));
  EXPECT_THAT(printed([&] {
                print_place(map, {1, 500, track::Direction::reverse}, false);
              }),
              HasSubstr("cant, twist      -50.0 mm (left rail higher), 0.100 mm per m"));
  EXPECT_THAT(printed([&] { print_place(map, {1, 0}, false); }), HasSubstr("cant, twist      0.0 mm, "));
  map.edges[1].alignment = track::Alignment::chained({}, {{100, 0, 1.0 / 500}});
  for (const auto direction : {track::Direction::forward, track::Direction::reverse}) {
    EXPECT_THAT(printed([&] {
                  print_place(map, {2, 50, direction}, false);
                }),
                HasSubstr("its rate         2.000e-05 per m2"));
  }
}

TEST(MapText, TheSummaryCountsTheKinds) {
  track::Map map = track::small_map();
  map.landmarks.push_back({4, track::LandmarkKind::underbridge, 1, 500, 0, 3, ""});
  map.landmarks.push_back({5, track::LandmarkKind::bridge, 1, 510, 0, 3, ""});
  map.landmarks.push_back({6, track::LandmarkKind::bridge, 1, 520, 0, 3, ""});
  const std::string text = printed([&] { print_summary(map); });
  EXPECT_THAT(text, HasSubstr("  underbridge    1\n"));
  EXPECT_THAT(text, HasSubstr("  bridge         2\n"));
}

TEST(MapText, EdgesWithoutVirtualGroupsAreTold) {
  const track::VirtualBalises some{.every_m = 500, .groups = 12, .short_edges = 7, .short_m = 1234};
  EXPECT_EQ(
      printed([&] { print_virtual_balises(some); }),
      "virtual groups   12\n  none           on 7 edges shorter than 250.0 m, half the distance: 1.234 km of track; "
      "a smaller distance puts some there\n");
  EXPECT_EQ(printed([] { print_virtual_balises({.every_m = 500, .groups = 12}); }), "virtual groups   12\n");
  EXPECT_EQ(printed([] { print_virtual_balises({}); }), "");
}

TEST(MapText, InfoListsAllProblems) {
  track::Map map = track::small_map();
  for (int i = 1; i <= 60; ++i) map.problems.push_back("problem " + std::to_string(i) + ".");
  EXPECT_THAT(printed([&] { print_info(map, 1); }), HasSubstr("  - problem 60.\n"));
  const std::string cut = printed([&] { print_problems(map.problems, 20); });
  EXPECT_THAT(cut, testing::EndsWith("  - problem 20.\n  ... and 40 more; `railfix map info MAP` lists all\n"));
}

}  // namespace
}  // namespace railfix::tool
