#include "monitor/topic_statistics.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "core/time.hpp"

namespace railfix::monitor::topic_statistics_test {
namespace {

constexpr int64_t kBegin_ns = 1'700'000'000 * core::kNsPerSecond;
constexpr int64_t kMs = 1'000'000;

SeenSample sample(int64_t at_ms, uint64_t sequence, int64_t latency_ms = 2) {
  const int64_t at_ns = kBegin_ns + at_ms * kMs;
  return {at_ns, at_ns, at_ns - latency_ms * kMs, sequence, 7, 100};
}

TEST(TopicStatistics, SaysNothingBeforeTheFirstSample) {
  const auto numbers = TopicStatistics().numbers(kBegin_ns);
  EXPECT_EQ(numbers.samples, 0U);
  EXPECT_FALSE(numbers.age_s);
  EXPECT_TRUE(std::isnan(numbers.latency_p50_ms));
}

TEST(TopicStatistics, MeasuresRateBandwidthAndAge) {
  TopicStatistics topic;
  for (int i = 0; i < 500; ++i) topic.add(sample(20 * i, static_cast<uint64_t>(i)));
  const auto numbers = topic.numbers(kBegin_ns + 10'000 * kMs);
  EXPECT_NEAR(numbers.hz, 50, 1);
  EXPECT_NEAR(numbers.bytes_per_s, 5000, 100);
  EXPECT_NEAR(*numbers.age_s, 0.02, 1e-9);
  EXPECT_EQ(numbers.gaps, 0U);
  EXPECT_EQ(numbers.lost, 0U);
  EXPECT_NEAR(topic.numbers(kBegin_ns + 20'000 * kMs).hz, 0, 1e-9) << "the rate is that of the last five seconds";
}

// received  . . . . . . . . . . . . . . . . . . . .         . . . .
// sequence  0 ...                                19        25 ...
TEST(TopicStatistics, CountsWhatIsMissingAndTheGap) {
  TopicStatistics topic;
  for (int i = 0; i < 20; ++i) topic.add(sample(10 * i, static_cast<uint64_t>(i)));
  for (int i = 25; i < 40; ++i) topic.add(sample(10 * i, static_cast<uint64_t>(i)));
  auto of_another_writer = sample(400, 1000);  // which counts for itself
  of_another_writer.writer = 8;
  topic.add(of_another_writer);
  const auto numbers = topic.numbers(kBegin_ns + 410 * kMs);
  EXPECT_EQ(numbers.lost, 5U);
  EXPECT_EQ(numbers.gaps, 1U);
  EXPECT_NEAR(numbers.longest_gap_s, 0.06, 1e-9);
  EXPECT_NEAR(topic.numbers(kBegin_ns + 5'000 * kMs).longest_gap_s, 4.6, 1e-9) << "the present silence counts";
  EXPECT_NEAR(topic.usual_gap_s(), 0.01, 1e-3);
}

// A standby goes on counting while nobody hears it; it is heard when the other one falls silent.
TEST(TopicStatistics, NothingIsLostWhenAStandbyTakesOver) {
  for (const bool exclusive : {true, false}) {
    TopicStatistics topic(exclusive);
    topic.add({kBegin_ns, kBegin_ns, kBegin_ns, 10, 1, 100});
    topic.add({kBegin_ns + kMs, kBegin_ns + kMs, kBegin_ns, 20, 2, 100});
    topic.add({kBegin_ns + 2 * kMs, kBegin_ns + 2 * kMs, kBegin_ns, 500, 1, 100});
    EXPECT_EQ(topic.numbers(kBegin_ns + 3 * kMs).lost, exclusive ? 0U : 489U);
    topic.add({kBegin_ns + 4 * kMs, kBegin_ns + 4 * kMs, kBegin_ns, 503, 1, 100});
    EXPECT_EQ(topic.numbers(kBegin_ns + 5 * kMs).lost, exclusive ? 2U : 491U);
  }
}

TEST(TopicStatistics, TellsLatencyByPercentileAndBucket) {
  TopicStatistics topic;
  for (int i = 0; i < 100; ++i) topic.add(sample(10 * i, static_cast<uint64_t>(i), i + 1));
  const auto numbers = topic.numbers(kBegin_ns + 1000 * kMs);
  EXPECT_NEAR(numbers.latency_p50_ms, 50, 1.5);
  EXPECT_NEAR(numbers.latency_p95_ms, 95, 1.5);
  EXPECT_NEAR(numbers.latency_p99_ms, 99, 1.5);
  uint64_t all = 0;
  for (const uint64_t count : topic.latency_counts()) all += count;
  EXPECT_EQ(all, 100U);
  EXPECT_EQ(topic.latency_counts()[4], 5U) << "6 to 10 ms";
  EXPECT_NEAR(topic.latency_sum_s(), 5.05, 1e-9);
  EXPECT_TRUE(std::isnan(topic.numbers(kBegin_ns + 60'000 * kMs).latency_p50_ms)) << "of the last ten seconds only";
}

}  // namespace
}  // namespace railfix::monitor::topic_statistics_test
