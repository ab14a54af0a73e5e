#include "evaluation/motion.hpp"

#include <gtest/gtest.h>

#include "made_truth.hpp"

namespace railfix::evaluation {
namespace {

std::vector<OdometryRow> odometry(const MadeTruth& made, double scale, double offset_m) {
  std::vector<OdometryRow> rows;
  for (int i = 0; i <= made.seconds * 60; ++i) {
    const auto real = made.row(i / 60.0);
    rows.push_back({real.stamp_ns, true, offset_m + scale * (real.distance_m - made.first_distance_m),
                    scale * made.speed_mps, "track"});
  }
  return rows;
}

TEST(Drift, OnePercentIsOnePercentOverAllAndInEveryWindow) {
  const MadeTruth made;  // 1000 m
  const auto result = judge_odometry(made.make(), odometry(made, 1.01, 77));
  EXPECT_NEAR(result.drift.travelled_m, 1000, 1e-6);
  EXPECT_NEAR(result.drift.error_m, 10, 1e-6);
  EXPECT_NEAR(result.drift.percent, 1.0, 1e-6);
  EXPECT_EQ(result.drift.window_percent.count, 91U);
  EXPECT_NEAR(result.drift.window_percent.mean, 1.0, 1e-6);
  EXPECT_NEAR(result.drift.window_percent.p95, 1.0, 1e-6);
  EXPECT_NEAR(result.speed_rms_mps, 0.2, 1e-9);
  EXPECT_EQ(result.valid_percent, 100);
  EXPECT_EQ(result.blind_percent, 0);
}

TEST(Drift, ErrorsThatCancelShowInTheWindowsOnly) {
  std::vector<MotionSample> samples;
  for (int metre = 0; metre <= 1000; ++metre) {
    samples.push_back({metre, double(metre), metre + (metre <= 500 ? 0.02 * metre : 0.02 * (1000 - metre)), 1, 1});
  }
  const Drift drift = drift_of(samples);
  EXPECT_NEAR(drift.percent, 0, 1e-9);
  EXPECT_NEAR(drift.window_percent.p50, 2, 1e-9);
  EXPECT_NEAR(drift.window_percent.max, 2, 1e-9);
}

TEST(Drift, CountsMetresBackAndForthAndStandstill) {
  std::vector<MotionSample> samples;
  const auto add = [&](double real) { samples.push_back({0, real, real, 0, 0}); };
  for (int i = 0; i <= 60; ++i) add(i);
  for (int i = 0; i < 100; ++i) add(60);
  for (int i = 60; i >= 0; --i) add(i);
  samples.back().distance_m = 0.6;
  const Drift drift = drift_of(samples);
  EXPECT_NEAR(drift.travelled_m, 120, 1e-9);
  EXPECT_NEAR(drift.percent, 0.5, 1e-9);
  EXPECT_EQ(drift.window_percent.count, 3U);  // from 0, 10 and 20 m
}

// A window for each sample, not one for every 10 m of a way that nobody has looked at.
TEST(Drift, SamplesFarApartTakeNoTime) {
  std::vector<MotionSample> samples;
  for (const double real : {0.0, 5.0, 200.0, 1e12, 1e12 + 200}) samples.push_back({0, real, real, 0, 0});
  EXPECT_EQ(drift_of(samples).window_percent.count, 3U);
}

TEST(Drift, NothingToCompareIsNotKnown) {
  EXPECT_TRUE(std::isnan(drift_of({}).percent));
  const MadeTruth made;
  auto rows = odometry(made, 1, 0);
  for (auto& row : rows) row.stamp_ns += 1000 * kSecond;
  EXPECT_TRUE(std::isnan(judge_odometry(made.make(), rows).drift.percent));
}

/// States displaced along and across the heading.
std::vector<StateRow> states(const MadeTruth& made, double along_m, double left_m, double over_m, double under_m) {
  std::vector<StateRow> rows;
  for (int i = 0; i < made.seconds * 10; ++i) {
    const auto real = made.row(i / 10.0 + 0.05);  // between two rows of the truth
    StateRow row;
    row.stamp_ns = real.stamp_ns;
    row.track_known = true;
    row.distance_m = real.distance_m;
    row.speed_mps = real.speed_mps;
    row.over_m = over_m;
    row.under_m = under_m;
    row.integrity = "ok";
    const double s = std::sin(made.heading_rad);
    const double c = std::cos(made.heading_rad);
    row.easting_m = real.easting_m + along_m * s - left_m * c;
    row.northing_m = real.northing_m + along_m * c + left_m * s;
    rows.push_back(row);
  }
  return rows;
}

TEST(Position, ErrorAlongAndAcrossForAnyHeading) {
  for (const double heading : {0.0, 0.7, 2.0, -2.5}) {
    MadeTruth made;
    made.heading_rad = heading;
    const auto result = judge_position(made.make(), states(made, -3, 1.2, 1, 4));
    ASSERT_TRUE(result.from_map);
    EXPECT_NEAR(result.error_m.p50, 3, 1e-6);
    EXPECT_NEAR(result.error_m.max, 3, 1e-6);
    EXPECT_NEAR(result.bias_m, -3, 1e-6);
    EXPECT_NEAR(result.samples.front().cross_m, 1.2, 1e-6);
    EXPECT_EQ(result.right_percent, 100);
    EXPECT_EQ(result.coverage_percent, 100);  // 3 m behind the true place, which may lie 4 m in front
    EXPECT_NEAR(result.interval_width_m.mean, 5, 1e-9);
  }
}

TEST(Position, CoverageTakesTheRightSideOfTheInterval) {
  const MadeTruth made;
  const auto coverage = [&](double along, double over, double under) {
    return judge_position(made.make(), states(made, along, 0, over, under)).coverage_percent;
  };
  EXPECT_EQ(coverage(3, 4, 1), 100);
  EXPECT_EQ(coverage(3, 1, 4), 0);
  EXPECT_EQ(coverage(-3, 4, 1), 0);
  EXPECT_EQ(coverage(-3, 1, 4), 100);
}

TEST(Position, StatesWithoutIntervalOrUnusableAreCountedApart) {
  const MadeTruth made;
  auto rows = states(made, 3, 0, 1, 1);
  const size_t quarter = rows.size() / 4;
  for (size_t i = 0; i < quarter; ++i) rows[i].over_m = kUnknown;
  for (size_t i = quarter; i < 2 * quarter; ++i) rows[i].integrity = "unusable";
  for (size_t i = 2 * quarter; i < 3 * quarter; ++i) rows[i].over_m = 5;
  const auto result = judge_position(made.make(), rows);
  EXPECT_EQ(result.without_interval, quarter);
  EXPECT_EQ(result.usable_percent, 75);
  EXPECT_NEAR(result.coverage_percent, 100.0 / 3, 1e-9);
  EXPECT_NEAR(result.coverage_usable_percent, 50, 1e-9);
}

TEST(Position, TrackChoice) {
  const MadeTruth made;
  auto rows = states(made, 0, 4.5, 1, 1);
  for (size_t i = 0; i < 100; ++i) rows[i].track_known = false;
  for (size_t i = 100; i < 300; ++i) rows[i] = states(made, 0, 0.3, 1, 1)[i];
  const auto result = judge_position(made.make(), rows);
  EXPECT_EQ(result.known_percent, 80);
  EXPECT_NEAR(result.known_after_s, 10, 1e-9);
  EXPECT_EQ(result.right_percent, 50);  // the other 200 are on the neighbouring track
  EXPECT_EQ(result.samples.size(), 400U);
}

TEST(Position, WithoutCoordinatesTheDistanceIsJudged) {
  const MadeTruth made;
  auto rows = states(made, 0, 0, 1, 1);
  for (size_t i = 0; i < rows.size(); ++i) {
    rows[i].easting_m = rows[i].northing_m = kUnknown;
    rows[i].distance_m += 100 + (i < 250 ? 0.0 : 2.0);
  }
  const auto result = judge_position(made.make(), rows);
  EXPECT_FALSE(result.from_map);
  EXPECT_NEAR(result.error_m.max, 2, 1e-6);
  EXPECT_NEAR(result.error_m.mean, 1, 1e-6);
  EXPECT_EQ(result.coverage_percent, 50);
  EXPECT_EQ(result.cross_m.count, 0U);
}

TEST(TruthTable, BetweenRowsAndOutside) {
  MadeTruth made;
  made.heading_rad = 1;
  const Truth truth = made.make();
  const auto real = truth.at(123'456'789);
  ASSERT_TRUE(real);
  EXPECT_NEAR(real->distance_m, 1000 + 20 * 0.123456789, 1e-9);
  EXPECT_FALSE(truth.at(-1));
  EXPECT_FALSE(truth.at(50 * kSecond + 1));
  EXPECT_TRUE(truth.at(50 * kSecond));
}

}  // namespace
}  // namespace railfix::evaluation
