// This host's clock is set back by an hour while the train runs: what is silent is still found to be, and what comes is
// shown. Each test gets the wall clock's times as they are then, and the monotonic clock's that go on.
#include <gtest/gtest.h>

#include "core/time.hpp"
#include "monitor/cab_watch.hpp"
#include "monitor/live_messages.hpp"
#include "monitor/newest.hpp"
#include "monitor/topic_statistics.hpp"

namespace railfix::monitor::clock_set_test {
namespace {

constexpr int64_t kWall_ns = 1'700'000'000 * core::kNsPerSecond;
constexpr int64_t kHourNs = 3600 * core::kNsPerSecond;
constexpr int64_t kMs = 1'000'000;

/// Of a sample that comes at this time after the start; the clock is set after the fifth second.
messaging::SampleInfo info_at(int64_t monotonic_ns) {
  messaging::SampleInfo info;
  info.arrived_ns = monotonic_ns;
  info.received_ns = kWall_ns + monotonic_ns - (monotonic_ns < 5 * core::kNsPerSecond ? 0 : kHourNs);
  info.source_ns = info.received_ns - 2 * kMs;
  return info;
}

SeenSample seen_at(int64_t monotonic_ns, uint64_t sequence) {
  const auto info = info_at(monotonic_ns);
  return {info.arrived_ns, info.received_ns, info.source_ns, sequence, 7, 100};
}

TEST(ClockSet, ATopicHasItsRateAndItsSilence) {
  TopicStatistics topic;
  for (int i = 0; i < 500; ++i) topic.add(seen_at(20 * i * kMs, static_cast<uint64_t>(i)));
  const auto numbers = topic.numbers(10'000 * kMs);
  EXPECT_NEAR(numbers.hz, 50, 1);
  EXPECT_EQ(numbers.gaps, 0U);
  EXPECT_NEAR(numbers.longest_gap_s, 0.02, 1e-9);
  EXPECT_NEAR(numbers.latency_p50_ms, 2, 1e-3);
  EXPECT_NEAR(*topic.numbers(13'000 * kMs).age_s, 3.02, 1e-9) << "it has stopped coming";
}

TEST(ClockSet, WhatIsSentNowIsNotTakenForWhatWasSentBefore) {
  EXPECT_EQ(seen_at(4'000 * kMs, 1).sent_ns(), 3'998 * kMs);
  EXPECT_EQ(seen_at(6'000 * kMs, 2).sent_ns(), 5'998 * kMs);
}

TEST(ClockSet, PicturesGoOn) {
  CabWatch cab(5);
  int taken = 0;
  for (int64_t ms = 4'000; ms < 6'000; ms += 100) {
    cab.picture("cam0", std::make_shared<msg::CameraPreview>(), info_at(ms * kMs));
    taken += static_cast<int>(cab.due((ms + 500) * kMs).size());
  }
  EXPECT_EQ(taken, 10);
}

TEST(ClockSet, TheNewestSampleGrowsOld) {
  Newest<msg::TrainState> state;
  state.take({"train_state", {}, std::make_shared<msg::TrainState>(), info_at(4'900 * kMs)});
  EXPECT_NEAR(state.age_s(11'900 * kMs), 7, 1e-9);
}

TEST(ClockSet, AServiceIsInItsStateSinceATimeOfTheClockAsItIsNow) {
  messaging::ServiceBoard board;
  board.note(msg::ServiceStatus(), info_at(4'000 * kMs).arrived_ns);
  const auto now = info_at(9'000 * kMs);
  const auto service = services_message(board, now.arrived_ns, now.received_ns)["services"][0];
  EXPECT_DOUBLE_EQ(service["age_s"], 5);
  EXPECT_EQ(service["since_ns"], now.received_ns - 5'000 * kMs);
}

TEST(ClockSet, AProblemIsSinceATimeOfTheClockAsItIsNow) {
  ProblemList list;
  list.update({{"a", Level::warning, "a", "", 0}}, info_at(4'000 * kMs).arrived_ns);
  const auto now = info_at(9'000 * kMs);
  const auto message = problems_message(list.problems(), now.arrived_ns, now.received_ns);
  EXPECT_EQ(message["now_ns"], now.received_ns);
  EXPECT_EQ(message["problems"][0]["since_ns"], now.received_ns - 5'000 * kMs);
}

}  // namespace
}  // namespace railfix::monitor::clock_set_test
