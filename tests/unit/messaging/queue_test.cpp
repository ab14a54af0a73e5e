#include <gtest/gtest.h>

#include <thread>

#include "core/time.hpp"
#include "messaging/messaging.hpp"

namespace railfix::messaging {
namespace {

TEST(Queue, RunsInOrderOfArrivalOverAllSources) {
  Queue queue;
  Queue::Source a;
  Queue::Source b;
  std::string order;
  queue.push(&a, [&] { order += "a"; });
  queue.push(&b, [&] { order += "b"; });
  queue.push(nullptr, [&] { order += "c"; });
  while (queue.run_one(0)) {
  }
  EXPECT_EQ(order, "abc");
}

TEST(Queue, DropsTheOldestOfTheFullSourceAndCounts) {
  Queue queue;
  Queue::Source small{.limit = 2};
  Queue::Source other;
  std::string order;
  queue.push(&other, [&] { order += "o"; });
  for (const char c : {'1', '2', '3', '4'}) queue.push(&small, [&order, c] { order += c; });
  while (queue.run_one(0)) {
  }
  EXPECT_EQ(order, "o34");
  EXPECT_EQ(small.dropped, 2U);
  EXPECT_EQ(queue.take_dropped(), 2U);
  EXPECT_EQ(queue.take_dropped(), 0U);
}

TEST(Queue, ForgottenSourcesRunNoMore) {
  Queue queue;
  Queue::Source source;
  queue.push(&source, [] { FAIL() << "its reader has gone"; });
  queue.forget(&source);
  EXPECT_FALSE(queue.run_one(0));
}

TEST(Queue, WakesUpWhenWorkComes) {
  Queue queue;
  bool ran = false;
  std::thread pusher([&] { queue.push(nullptr, [&] { ran = true; }); });
  EXPECT_TRUE(queue.run_one(core::monotonic_ns() + 10 * core::kNsPerSecond));
  pusher.join();
  EXPECT_TRUE(ran);
}

}  // namespace
}  // namespace railfix::messaging
