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

// Nine services say how they are, each four times a second: how their words lie to each other is no gap.
TEST(TopicStatistics, CountsTheGapsOfEachWriter) {
  TopicStatistics topic;
  const auto word = [](int64_t at_ms, uint64_t i, uint64_t writer) {
    auto made = sample(at_ms, i);
    made.writer = writer;
    return made;
  };
  for (uint64_t i = 0; i < 40; ++i) {
    for (uint64_t writer = 1; writer <= 9; ++writer) {
      topic.add(word(static_cast<int64_t>(250 * i + writer), i, writer));
    }
  }
  EXPECT_EQ(topic.numbers(kBegin_ns + 10'000 * kMs).gaps, 0U);
  EXPECT_NEAR(topic.usual_gap_s(), 0.25, 1e-3);
  for (uint64_t writer = 2; writer <= 9; ++writer) topic.add(word(static_cast<int64_t>(10'000 + writer), 40, writer));
  topic.add(word(12'000, 40, 1));
  EXPECT_EQ(topic.numbers(kBegin_ns + 12'000 * kMs).gaps, 1U) << "the first one was silent for two seconds";
}

// Ten samples a second of one writer; it is started anew, and has one in three seconds from then on.
TEST(TopicStatistics, ForgetsThePaceOfAWriterThatIsGone) {
  TopicStatistics topic;
  for (int i = 0; i < 100; ++i) topic.add(sample(100 * i, static_cast<uint64_t>(i)));
  EXPECT_NEAR(topic.usual_gap_s(), 0.1, 1e-3);
  for (int i = 0; i < 30; ++i) {
    auto anew = sample(10'000 + 3'000 * i, static_cast<uint64_t>(i));
    anew.writer = 8;
    topic.add(anew);
  }
  EXPECT_NEAR(topic.usual_gap_s(), 3, 1e-3);
}

TEST(BeforeListening, IsOnlyWhatAStandingValueWas) {
  constexpr int64_t kHour_ms = 3'600'000;
  const int64_t since_ns = kBegin_ns;
  BeforeListening standing(true, since_ns);
  EXPECT_TRUE(standing.was_sent(sample(10, 1, 5'000)));
  EXPECT_FALSE(standing.was_sent(sample(20, 2, 5)));
  EXPECT_TRUE(standing.was_sent(sample(30, 3, kHour_ms))) << "of a clock that is behind it cannot be told ...";
  EXPECT_FALSE(standing.was_sent(sample(2'100, 4, kHour_ms))) << "... but by now it has come";
  BeforeListening flowing(false, since_ns);
  EXPECT_FALSE(flowing.was_sent(sample(10, 1, kHour_ms))) << "a clock that is ahead silences no topic";
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
