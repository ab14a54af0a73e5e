#include "map_matcher/track_choice/gyro_turn.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "core/random.hpp"

namespace railfix::map_matcher {
namespace {

constexpr int64_t kPeriodNs = 10'000'000;

/// With some noise: a gyro that says the same again and again is stuck.
void feed(GyroTurn& gyro, int64_t from_ns, int64_t to_ns, double rate_rps) {
  for (int64_t t = from_ns; t <= to_ns; t += kPeriodNs) gyro.add(t, rate_rps + (t / kPeriodNs % 2 == 0 ? 1e-9 : -1e-9));
}

TEST(GyroTurn, SumsTheRatesBetweenAnyTwoMoments) {
  GyroTurn gyro({});
  feed(gyro, kPeriodNs, 3'000'000'000, 0.02);
  const auto turn = gyro.between(1'003'000'000, 2'503'000'000);
  ASSERT_TRUE(turn);
  EXPECT_NEAR(turn->turn_rad, 0.03, 1e-9);
  EXPECT_EQ(turn->sensor, TurnSensor::gyro);
  EXPECT_NEAR(turn->sigma_rad, 1e-3 * std::sqrt(1.5), 1e-9);
  EXPECT_NEAR(turn->bias_rad, 0.002 * 1.5, 1e-9);
  EXPECT_NEAR(turn->bias_walk, 1.5 * 1e-5 * 1e-5 / (0.002 * 0.002), 1e-12);
}

TEST(GyroTurn, SaysNothingWhereSamplesAreMissing) {
  GyroTurn gyro({});
  EXPECT_FALSE(gyro.between(0, kPeriodNs));
  feed(gyro, kPeriodNs, 1'000'000'000, 0.02);
  EXPECT_FALSE(gyro.between(0, 500'000'000)) << "before the first";
  EXPECT_FALSE(gyro.between(500'000'000, 1'500'000'000)) << "long after the last";
  feed(gyro, 2'000'000'000, 3'000'000'000, 0.02);
  EXPECT_FALSE(gyro.between(500'000'000, 2'500'000'000)) << "over a gap";
  gyro.add(2'100'000'000, 0.02);  // the clock was set back
  EXPECT_FALSE(gyro.between(2'500'000'000, 2'900'000'000));
}

TEST(GyroTurn, AStuckGyroSaysNothingUntilItIsWellAgain) {
  GyroTurn gyro({});
  feed(gyro, kPeriodNs, 1'000'000'000, 0.02);
  for (int64_t t = 1'000'000'000 + kPeriodNs; t <= 2'000'000'000; t += kPeriodNs) gyro.add(t, 0.03);
  feed(gyro, 2'000'000'000 + kPeriodNs, 3'000'000'000, 0.02);
  EXPECT_TRUE(gyro.between(500'000'000, 1'000'000'000));
  EXPECT_FALSE(gyro.between(900'000'000, 1'100'000'000));
  EXPECT_FALSE(gyro.between(1'501'000'000, 1'502'000'000)) << "between two samples";
  EXPECT_FALSE(gyro.between(1'900'000'000, 2'100'000'000));
  EXPECT_TRUE(gyro.between(2'100'000'000, 2'900'000'000));
  EXPECT_TRUE(gyro.at_rest(1'900'000'000, 2'100'000'000));
}

// Two or three equal samples are steps of its scale.
TEST(GyroTurn, CoarseStepsAreNotStuck) {
  GyroTurn gyro({});
  core::Random random(6);
  int missing = 0;
  for (int i = 1; i <= 3000; ++i) {
    constexpr double kStepRps = 1.07e-3;
    gyro.add(i * kPeriodNs, kStepRps * std::round((0.01 + 0.75 * kStepRps * random.normal()) / kStepRps));
    if (i > 100 && i % 10 == 0 && !gyro.between((i - 10) * kPeriodNs, i * kPeriodNs)) ++missing;
  }
  EXPECT_LE(missing, 3);
}

TEST(GyroTurn, OneThatScattersMoreThanItShouldSaysLess) {
  GyroTurn gyro({});
  core::Random random(5);
  const auto scatter = [&](int64_t from_ns, double sigma_rps) {
    for (int64_t t = from_ns; t < from_ns + 3'000'000'000; t += kPeriodNs) gyro.add(t, sigma_rps * random.normal());
    return gyro.between(from_ns + 2'000'000'000, from_ns + 2'900'000'000)->sigma_rad / std::sqrt(0.9);
  };
  EXPECT_NEAR(scatter(kPeriodNs, 0.01), 1e-3, 1e-9) << "as promised";
  EXPECT_NEAR(scatter(3'000'000'000 + kPeriodNs, 0.1), 1e-2, 3e-3);
  EXPECT_NEAR(scatter(6'000'000'000 + kPeriodNs, 0.01), 1e-3, 1e-9);
}

TEST(GyroTurn, LearnsItsErrorWhileTheTrainStandsAndForgetsItSlowly) {
  GyroTurn gyro({});
  constexpr double kBiasRps = 0.0017;
  for (int64_t t = 0; t < 20'000'000'000; t += 100'000'000) {
    feed(gyro, t + kPeriodNs, t + 100'000'000, kBiasRps);
    if (t > 0) gyro.stood(t, t + 100'000'000);
  }
  const auto soon = gyro.between(19'000'000'000, 20'000'000'000);
  ASSERT_TRUE(soon);
  EXPECT_NEAR(soon->turn_rad, 0, 2 * soon->bias_rad);
  EXPECT_LT(soon->bias_rad, 0.0003);
  const int64_t later_ns = 20'000'000'000 + 3'600'000'000'000;
  feed(gyro, later_ns, later_ns + 1'000'000'000, kBiasRps);
  const auto later = gyro.between(later_ns, later_ns + 1'000'000'000);
  ASSERT_TRUE(later);
  EXPECT_GT(later->bias_rad, 2 * soon->bias_rad);
  EXPECT_LE(later->bias_rad, 0.002 + 1e-9);
}

}  // namespace
}  // namespace railfix::map_matcher
