#include "service/data_time.hpp"

#include <gtest/gtest.h>

#include <optional>

namespace railfix::service::data_time_test {
namespace {

constexpr int64_t kMs = 1'000'000;
constexpr int64_t kWallNs = 1'700'000'000 * core::kNsPerSecond;

class DataTimeTest : public ::testing::Test {
 protected:
  /// Data of long ago is played on a host; this one's clock is ahead of it by `ahead_ns`.
  void hear(int64_t ahead_ns, int64_t way_ns, msg::DataClock clock = {}) {
    clock.data_ns(1000 * kMs);
    clock.wall_ns(kWallNs);
    time_.emplace(clock, kWallNs + way_ns + ahead_ns, 77 * kMs + way_ns);
  }
  std::optional<DataTime> time_;
};

TEST_F(DataTimeTest, GoesOnFromTheClockAndItsWay) {
  hear(0, 30 * kMs);
  EXPECT_EQ(time_->at(77 * kMs + 30 * kMs), 1030 * kMs);
  EXPECT_EQ(time_->at(77 * kMs + 530 * kMs), 1530 * kMs);
}

TEST_F(DataTimeTest, AWrongClockOfThisHostChangesNothingButTheWay) {
  for (const int64_t ahead_ns : {5000 * kMs, -5000 * kMs, 3'600'000 * kMs}) {
    hear(ahead_ns, 30 * kMs);
    EXPECT_EQ(time_->at(77 * kMs + 530 * kMs), 1500 * kMs);
  }
}

TEST_F(DataTimeTest, StandsInLockStepAndBehindTheEnd) {
  hear(0, 30 * kMs);
  EXPECT_FALSE(time_->stands());
  msg::DataClock step;
  step.lock_step(1);
  hear(0, 30 * kMs, step);
  EXPECT_TRUE(time_->stands());
  msg::DataClock last;
  last.ended(1);
  hear(0, 30 * kMs, last);
  EXPECT_TRUE(time_->stands());
  hear(0, 30 * kMs);
  EXPECT_FALSE(time_->stands());
}

}  // namespace
}  // namespace railfix::service::data_time_test
