#include "odometry/standstill.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "core/random.hpp"
#include "core/time.hpp"

namespace railfix::odometry::standstill_test {
namespace {

constexpr double kRate = 60;

// Feeds places measured with noise; returns what was reported last.
class Feed {
 public:
  explicit Feed(double noise_m) : noise_m_(noise_m) {}
  double at(double true_m) {
    return standstill.report(core::to_ns(1 + static_cast<double>(count_++) / kRate),
                             true_m + random_.normal(0, noise_m_));
  }
  Standstill standstill{0.003};

 private:
  double noise_m_;
  core::Random random_{7};
  int64_t count_ = 0;
};

void brake(Feed& feed, double to_m) {
  for (int i = 60; i > 0; --i) feed.at(to_m - 0.5 * std::pow(i / kRate, 2));
}

TEST(Standstill, TenMinutesAreExactlyNothing) {
  for (const double noise_m : {0.0002, 0.002}) {
    Feed feed(noise_m);
    brake(feed, 10);
    for (int i = 0; i < 75; ++i) feed.at(10);
    const double stopped_m = feed.at(10);
    EXPECT_NEAR(stopped_m, 10, 2 * noise_m);
    for (int i = 0; i < 36'000; ++i) ASSERT_EQ(feed.at(10), stopped_m) << "noise " << noise_m << ", picture " << i;
    EXPECT_EQ(feed.standstill.recent_speed_mps(), 0);
  }
}

TEST(Standstill, CreepingIsNotStandstill) {
  Feed feed(0.0002);
  brake(feed, 10);
  for (int i = 0; i < 60; ++i) feed.at(10);
  double reported_m = 0;
  for (int i = 0; i < 600; ++i) {
    const double true_m = 10 + 0.02 * i / kRate;
    reported_m = feed.at(true_m);
    EXPECT_NEAR(reported_m, true_m, 0.0075) << i;
    EXPECT_TRUE(i <= 30 || !feed.standstill.resting()) << i;
  }
  EXPECT_NEAR(reported_m, 10.2, 0.001);
  EXPECT_NEAR(feed.standstill.recent_speed_mps(), 0.02, 0.005);
}

TEST(Standstill, LeavingLateCostsNoDistance) {
  Feed feed(0.0015);
  brake(feed, 10);
  for (int i = 0; i < 120; ++i) feed.at(10);
  ASSERT_TRUE(feed.standstill.resting());
  double reported_m = 0;
  double true_m = 10;
  for (int i = 0; i < 60; ++i) {
    true_m = 10 - 0.5 * std::pow(i / kRate, 2);
    reported_m = feed.at(true_m);
    EXPECT_NEAR(reported_m, true_m, 0.04) << i;
  }
  EXPECT_NEAR(reported_m, true_m, 0.006);
}

// The long window is full at any rate: a trembling camera settles by nothing else.
TEST(Standstill, AFastCameraSettlesToo) {
  constexpr double kFast = 400;
  Standstill standstill(0.003);
  core::Random random(7);
  int i = 0;
  const auto at = [&](double true_m) {
    return standstill.report(core::to_ns(1 + i++ / kFast), true_m + random.normal(0, 0.002));
  };
  for (int k = 400; k > 0; --k) at(10 - 0.5 * std::pow(k / kFast, 2));
  for (int k = 0; k < 600; ++k) at(10);
  ASSERT_TRUE(standstill.resting());
  const double stopped_m = at(10);
  for (int k = 0; k < 4000; ++k) ASSERT_EQ(at(10), stopped_m) << k;
}

TEST(Standstill, CreepingWith10MillimetresASecondIsNoRestAtAnyRate) {
  for (const double rate_hz : {12.0, 15.0, 60.0}) {
    Standstill standstill(0.003);
    double reported_m = 0;
    for (int i = 0; i < 10 * static_cast<int>(rate_hz); ++i) {
      reported_m = standstill.report(core::to_ns(1 + i / rate_hz), 0.01 * i / rate_hz);
      EXPECT_FALSE(i > rate_hz && standstill.resting()) << rate_hz << " " << i;
    }
    EXPECT_NEAR(reported_m, 0.1, 0.001) << rate_hz;
  }
}

TEST(Standstill, ADepartureAtOnceIsSeenAtOnce) {
  Feed feed(0);
  EXPECT_EQ(feed.at(0.001), 0);
  EXPECT_EQ(feed.at(0.7), 0.7);
}

}  // namespace
}  // namespace railfix::odometry::standstill_test
