#include "recording/topic_summary.hpp"

#include <gtest/gtest.h>

#include "core/time.hpp"

namespace railfix::tool {
namespace {

constexpr RecordedTime kMinute{100 * core::kNsPerSecond, 160 * core::kNsPerSecond};

mcap::Channel topic(const std::string& name) {
  return {1, 1, name, "cdr", {}};
}

/// Evenly from the one second to the other, counted from the recording's beginning.
mcap::ChannelContent content(uint64_t messages, double from_s, double to_s) {
  const double gap_s = messages < 2 ? 0 : (to_s - from_s) / static_cast<double>(messages - 1);
  return {messages, 0, kMinute.start_ns + core::to_ns(from_s), kMinute.start_ns + core::to_ns(to_s),
          core::to_ns(gap_s)};
}

TEST(TopicSummary, ASensorThatDiedHasItsRateAndTheSilenceThatFollowed) {
  const auto summary = summary_of(topic("imu_sample"), content(2001, 0, 20), kMinute);
  EXPECT_DOUBLE_EQ(summary.rate_hz, 100);
  EXPECT_DOUBLE_EQ(summary.longest_gap_s, 40);
  EXPECT_DOUBLE_EQ(summary.between_s, 0.01);
  EXPECT_FALSE(summary.begins_late);
  EXPECT_TRUE(summary.ends_early);
  EXPECT_DOUBLE_EQ(summary.ends_s, 20);
}

TEST(TopicSummary, ASensorThatCameLateWasSilentBefore) {
  const auto summary = summary_of(topic("gnss_fix"), content(31, 30, 60), kMinute);
  EXPECT_DOUBLE_EQ(summary.rate_hz, 1);
  EXPECT_DOUBLE_EQ(summary.longest_gap_s, 30);
  EXPECT_TRUE(summary.begins_late);
  EXPECT_DOUBLE_EQ(summary.begins_s, 30);
  EXPECT_FALSE(summary.ends_early);
}

TEST(TopicSummary, AboutBeginAndEndIsWithinAStartOrTwoOfItsPeriods) {
  EXPECT_FALSE(summary_of(topic("imu_sample"), content(5901, 0.9, 59.9), kMinute).begins_late);
  EXPECT_TRUE(summary_of(topic("imu_sample"), content(5801, 1.1, 59.1), kMinute).begins_late);
  const auto slow = summary_of(topic("data_clock"), content(6, 4, 54), kMinute);
  EXPECT_FALSE(slow.begins_late);
  EXPECT_FALSE(slow.ends_early);
}

TEST(TopicSummary, WhatIsSaidNowAndThenIsCountedOverTheRecording) {
  for (const char* name : {"log_record", "train_position_report", "landmark_sighting"}) {
    const auto summary = summary_of(topic(name), content(3, 20, 20.2), kMinute);
    EXPECT_FALSE(summary.periodic) << name;
    EXPECT_DOUBLE_EQ(summary.rate_hz, 0.05) << name;
    EXPECT_NEAR(summary.longest_gap_s, 0.1, 1e-9) << name;
    EXPECT_TRUE(summary.begins_late && summary.ends_early) << name;
  }
}

TEST(TopicSummary, OneSampleHasNoRateOfItsOwn) {
  EXPECT_DOUBLE_EQ(summary_of(topic("imu_sample"), content(1, 30, 30), kMinute).rate_hz, 1.0 / 60);
  const RecordedTime moment{5, 5};
  EXPECT_EQ(summary_of(topic("imu_sample"), {1, 0, 5, 5, 0}, moment).rate_hz, 0);
}

}  // namespace
}  // namespace railfix::tool
