#include "topic_watch.hpp"

#include <gmock/gmock.h>

#include "messaging/topics.hpp"

namespace railfix::tool {

namespace {

messaging::SampleInfo at(int64_t received_ms, uint64_t sequence, uint64_t writer = 1) {
  messaging::SampleInfo info;
  info.received_ns = received_ms * 1'000'000;
  info.source_ns = info.received_ns - 2'000'000;
  info.sequence = sequence;
  info.writer = writer;
  return info;
}

const messaging::TopicInfo kOpen = messaging::info_of(messaging::topics::track_view);
const messaging::TopicInfo kExclusive = messaging::info_of(messaging::topics::train_state);

TEST(TopicStatistics, RateAndGaps) {
  TopicStatistics statistics;
  EXPECT_EQ(statistics.rate_hz(), 0);
  statistics.add(kOpen, at(1000, 1));
  EXPECT_EQ(statistics.rate_hz(), 0);
  for (const int64_t ms : {1020, 1030, 1100}) statistics.add(kOpen, at(ms, 2));
  EXPECT_EQ(statistics.samples(), 4U);
  EXPECT_DOUBLE_EQ(statistics.rate_hz(), 30.0);
  EXPECT_DOUBLE_EQ(statistics.shortest_gap_ms(), 10.0);
  EXPECT_DOUBLE_EQ(statistics.longest_gap_ms(), 70.0);
  EXPECT_DOUBLE_EQ(statistics.latency_ms(), 2.0);
}

TEST(TopicStatistics, WhatIsSaidNowAndThenIsCountedOverTheListening) {
  TopicStatistics statistics;
  EXPECT_EQ(statistics.rate_hz(3), 0);
  statistics.add(kOpen, at(1000, 1));
  EXPECT_DOUBLE_EQ(statistics.rate_hz(4), 0.25);
  statistics.add(kOpen, at(1010, 2));
  EXPECT_DOUBLE_EQ(statistics.rate_hz(4), 0.5);
  statistics.add(kOpen, at(3000, 3));
  EXPECT_DOUBLE_EQ(statistics.rate_hz(4), 1) << "these fill the time: from the first to the last";
}

TEST(TopicStatistics, LossesAreCountedForEachWriter) {
  TopicStatistics statistics;
  statistics.add(kOpen, at(10, 10, 1));
  statistics.add(kOpen, at(11, 500, 2));
  statistics.add(kOpen, at(12, 11, 1));
  EXPECT_EQ(statistics.lost(), 0U);
  statistics.add(kOpen, at(13, 15, 1));
  statistics.add(kOpen, at(14, 502, 2));
  EXPECT_EQ(statistics.lost(), 4U);
  EXPECT_EQ(statistics.samples(), 5U);
}

// What stood there before somebody listened may be the last of many that nobody keeps.
TEST(TopicStatistics, NothingIsLostBetweenAStandingValueAndTheNext) {
  TopicStatistics statistics(1'000'000'000);
  statistics.add(kOpen, at(1, 3, 1));
  statistics.add(kOpen, at(2000, 2733, 1));
  EXPECT_EQ(statistics.lost(), 0U);
  statistics.add(kOpen, at(2010, 2735, 1));
  EXPECT_EQ(statistics.lost(), 1U);
}

// A standby goes on counting while nobody hears it; it is heard when the other one falls silent.
TEST(TopicStatistics, NothingIsLostWhenAStandbyTakesOver) {
  TopicStatistics statistics;
  statistics.add(kExclusive, at(0, 10, 1));
  statistics.add(kExclusive, at(1, 20, 2));
  statistics.add(kExclusive, at(2, 500, 1));
  statistics.add(kExclusive, at(3, 501, 1));
  EXPECT_EQ(statistics.lost(), 0U);
  statistics.add(kExclusive, at(4, 505, 1));
  EXPECT_EQ(statistics.lost(), 3U);
}

}  // namespace

}  // namespace railfix::tool
