#include "service/clock_watch.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/time.hpp"

namespace railfix::service::clock_watch_test {
namespace {

constexpr int64_t kMs = 1'000'000;

class ClockWatchTest : public ::testing::Test {
 protected:
  void hear(const std::string& host, int64_t ahead_ns, int64_t way_ns, size_t count = ClockWatch::kMessages) {
    for (size_t i = 0; i < count; ++i, now_ns_ += 250 * kMs) {
      const int64_t received_ns = now_ns_ + set_by_ns_ + way_ns;
      watch_.look(received_ns, now_ns_ + way_ns - kBootedNs);
      watch_.hear(host, now_ns_ + ahead_ns, received_ns);
    }
  }
  static constexpr int64_t kBootedNs = 1'600'000'000 * core::kNsPerSecond;
  int64_t set_by_ns_ = 0;
  ClockWatch watch_{"coach"};
  int64_t now_ns_ = 1'700'000'000 * core::kNsPerSecond;
};

TEST_F(ClockWatchTest, ClocksThatAgreeAreNoTrouble) {
  hear("cab", 20 * kMs, 30 * kMs);
  EXPECT_EQ(watch_.trouble(), "");
}

TEST_F(ClockWatchTest, SaysWhichIsOffByHowMuchAndWhatToDo) {
  hear("cab", -1300 * kMs, 1 * kMs);
  EXPECT_EQ(watch_.trouble(),
            "The clock of cab is 1.3 s behind coach's: let chrony or PTP set both (railfix doctor says which is not).");
  hear("cab", 2000 * kMs, 1 * kMs);
  EXPECT_EQ(
      watch_.trouble(),
      "The clock of cab is 2.0 s ahead of coach's: let chrony or PTP set both (railfix doctor says which is not).");
  hear("cab", 0, 1 * kMs);
  EXPECT_EQ(watch_.trouble(), "");
}

TEST_F(ClockWatchTest, AHostThatIsGoneIsForgotten) {
  hear("coach7", -3000 * kMs, 1 * kMs);
  EXPECT_NE(watch_.trouble(), "");
  hear("cab", 0, 1 * kMs, 80);  // 20 s
  EXPECT_EQ(watch_.trouble(), "");
}

TEST_F(ClockWatchTest, SlowMessagesAreNoWrongClock) {
  hear("cab", 0, 3000 * kMs, ClockWatch::kMessages - 1);  // what a new reader gets of the past, a cable that was cut
  EXPECT_EQ(watch_.trouble(), "");
  hear("cab", 0, 2 * kMs, 1);
  EXPECT_EQ(watch_.trouble(), "");
}

TEST_F(ClockWatchTest, AClockThatWasSetIsDoubtedUntilItAgrees) {
  for (const int64_t set_by_ns : {5000 * kMs, -5000 * kMs}) {
    hear("cab", 0, 1 * kMs);
    EXPECT_FALSE(watch_.own_is_doubted());
    set_by_ns_ = set_by_ns;
    watch_.look(now_ns_ + set_by_ns_, now_ns_ - kBootedNs);
    EXPECT_TRUE(watch_.own_is_doubted());
    watch_.hear("cab", now_ns_ - 1 * kMs, now_ns_);  // waited in the queue when the clock was set
    hear("cab", 0, 1 * kMs);
    EXPECT_TRUE(watch_.own_is_doubted());
    EXPECT_THAT(watch_.trouble(),
                ::testing::StartsWith(set_by_ns > 0 ? "The clock of coach was set by +5.0 s. The clock"
                                                    : "The clock of coach was set by -5.0 s. The clock"));
    set_by_ns_ = 0;
    hear("cab", 0, 1 * kMs, ClockWatch::kMessages - 1);
    EXPECT_TRUE(watch_.own_is_doubted()) << "not heard enough since";
    hear("cab", 0, 1 * kMs, 1);
    EXPECT_FALSE(watch_.own_is_doubted());
    EXPECT_EQ(watch_.trouble(), "");
  }
}

TEST_F(ClockWatchTest, AClockThatIsSetRightIsNotDoubtedForLong) {
  hear("cab", 1300 * kMs, 1 * kMs);
  EXPECT_FALSE(watch_.own_is_doubted()) << "nobody knows which of the two is wrong";
  set_by_ns_ = 1300 * kMs;
  hear("cab", 1300 * kMs, 1 * kMs, ClockWatch::kMessages - 1);
  EXPECT_TRUE(watch_.own_is_doubted());
  hear("cab", 1300 * kMs, 1 * kMs, 1);
  EXPECT_FALSE(watch_.own_is_doubted());
}

TEST_F(ClockWatchTest, ItsOwnHostHasTheSameClock) {
  hear("coach", 5000 * kMs, 0);
  EXPECT_EQ(watch_.trouble(), "");
}

TEST_F(ClockWatchTest, SaysWhenNobodyKeepsTheClockAnyMore) {
  watch_.kept(std::nullopt);
  EXPECT_EQ(watch_.trouble(), "") << "nobody ever did: railfix train check says that";
  watch_.kept(2 * kMs);
  EXPECT_EQ(watch_.trouble(), "");
  watch_.kept(150 * kMs);
  EXPECT_EQ(watch_.trouble(),
            "The clock of coach is not kept by PTP or NTP any more: see to its chronyd, or ptp4l and phc2sys.");
  EXPECT_FALSE(watch_.own_is_doubted()) << "it still agrees with the others";
  watch_.kept(1 * kMs);
  EXPECT_EQ(watch_.trouble(), "");
  watch_.kept(std::nullopt);
  EXPECT_NE(watch_.trouble(), "");
}

}  // namespace
}  // namespace railfix::service::clock_watch_test
