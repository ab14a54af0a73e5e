#include "evaluation/statistics.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "evaluation/plot.hpp"

namespace railfix::evaluation {
namespace {

TEST(Statistics, OfKnownValuesInAnyOrder) {
  std::vector<double> values;
  for (int i = 100; i >= 0; --i) values.push_back(i);
  values.push_back(kUnknown);
  const Summary summary = summarise(values);
  EXPECT_EQ(summary.count, 101U);
  EXPECT_DOUBLE_EQ(summary.mean, 50);
  EXPECT_DOUBLE_EQ(summary.p50, 50);
  EXPECT_DOUBLE_EQ(summary.p95, 95);
  EXPECT_DOUBLE_EQ(summary.max, 100);
  EXPECT_DOUBLE_EQ(root_mean_square({3, -4, kUnknown}), std::sqrt(12.5));
}

TEST(Statistics, NothingIsNotKnown) {
  EXPECT_EQ(summarise({}).count, 0U);
  EXPECT_TRUE(std::isnan(summarise({kUnknown}).mean));
  EXPECT_TRUE(std::isnan(root_mean_square({})));
  EXPECT_TRUE(std::isnan(percent(0, 0)));
  EXPECT_EQ(percent(1, 4), 25);
}

TEST(Plot, TicksAreRoundAndInside) {
  EXPECT_EQ(ticks(0, 10, 5), (std::vector<double>{0, 2, 4, 6, 8, 10}));
  EXPECT_EQ(ticks(-1, 1, 4), (std::vector<double>{-1, -0.5, 0, 0.5, 1}));
  EXPECT_EQ(ticks(3, 3, 5).size(), 1U);
}

TEST(Plot, ManyPointsStaySmallAndPeaksSurvive) {
  Plot plot{"t", "x", "y", {{"s", "#000", {}}}};
  for (int i = 0; i < 100'000; ++i) plot.series[0].points.emplace_back(i, i == 50'001 ? 100.0 : std::sin(i));
  const std::string svg = line_svg(plot);
  EXPECT_LT(svg.size(), 60'000U);
  // The peak is the top of the range but for the 5 % margin: 30 px + 5 / 110 of the height of 226 px.
  EXPECT_NE(svg.find(",40.3 "), std::string::npos);
}

TEST(Plot, GapsInterruptTheLineAndTextIsEscaped) {
  const std::string svg =
      line_svg({"a < b & c", "x", "y", {{"s", "#000", {{0, 0}, {1, 1}, {2, kUnknown}, {3, 3}, {4, 4}}}}});
  EXPECT_NE(svg.find("a &lt; b &amp; c"), std::string::npos);
  size_t lines = 0;
  for (size_t at = svg.find("<polyline"); at != std::string::npos; at = svg.find("<polyline", at + 1)) ++lines;
  EXPECT_EQ(lines, 2U);
  EXPECT_EQ(line_svg({"empty", "x", "y", {}}).find("nan"), std::string::npos);
}

TEST(Plot, StanfordCountsBoundsThatWereTooSmall) {
  EXPECT_NE(stanford_svg({{1, 2}, {3, 2}, {2, 2}}).find("1 of 3 samples"), std::string::npos);
}

}  // namespace
}  // namespace railfix::evaluation
