#include "tpr_publisher/ground_link/outbox.hpp"

#include <gmock/gmock.h>

#include "core/random.hpp"

namespace railfix::tpr_publisher {
namespace {

using ::testing::ElementsAre;

TEST(Outbox, SendsInOrderAndOnlySoManyAtATime) {
  Outbox outbox(2);
  for (const uint64_t sequence : {7U, 8U, 9U}) outbox.stored(sequence);
  EXPECT_FALSE(outbox.next().has_value());  // not connected
  outbox.connected();
  EXPECT_EQ(outbox.next(), 7U);
  outbox.published(101);
  EXPECT_EQ(outbox.next(), 8U);
  outbox.published(102);
  EXPECT_FALSE(outbox.next().has_value());
  EXPECT_EQ(outbox.delivered(101), 7U);
  EXPECT_EQ(outbox.delivered(101), std::nullopt);
  EXPECT_EQ(outbox.next(), 9U);
  EXPECT_EQ(outbox.size(), 2U);
}

TEST(Outbox, NothingOvertakesWhatIsRepeated) {
  Outbox outbox(5);
  for (const uint64_t sequence : {1U, 2U, 3U}) outbox.stored(sequence);
  outbox.connected();
  outbox.published(1);
  outbox.published(2);
  outbox.disconnected();
  EXPECT_FALSE(outbox.next().has_value());
  outbox.connected();
  EXPECT_FALSE(outbox.next().has_value());
  EXPECT_EQ(outbox.delivered(2), 2U);
  EXPECT_FALSE(outbox.next().has_value());
  EXPECT_EQ(outbox.delivered(1), 1U);
  EXPECT_EQ(outbox.next(), 3U);
}

TEST(Outbox, WhatIsNotStoredGoesBehindWhatIs) {
  Outbox outbox(2);
  EXPECT_FALSE(outbox.takes_unstored());  // not connected
  outbox.stored(7);
  outbox.connected();
  EXPECT_FALSE(outbox.takes_unstored());
  outbox.published(101);
  EXPECT_TRUE(outbox.takes_unstored());
  outbox.published_unstored(102);
  EXPECT_FALSE(outbox.takes_unstored()) << "two are under way";
  outbox.disconnected();
  outbox.connected();
  EXPECT_EQ(outbox.delivered(101), 7U);
  EXPECT_FALSE(outbox.takes_unstored()) << "102 is repeated";
  EXPECT_EQ(outbox.delivered(102), std::nullopt);
  EXPECT_TRUE(outbox.takes_unstored());
}

TEST(Outbox, DropsTheOldestBeyondTheLimit) {
  Outbox outbox(1);
  for (uint64_t sequence = 1; sequence <= 6; ++sequence) outbox.stored(sequence);
  outbox.connected();
  outbox.published(1);
  EXPECT_THAT(outbox.limit(3), ElementsAre(2U, 3U));
  EXPECT_EQ(outbox.delivered(1), 1U);
  EXPECT_EQ(outbox.next(), 4U);
  outbox.skip();
  EXPECT_EQ(outbox.next(), 5U);
}

// A link that breaks at random, and a client that repeats what was under way in its order, as Mosquitto's does.
TEST(Outbox, OverABadLinkEverythingArrivesInOrderOrTwice) {
  core::Random random(4);
  Outbox outbox(4);
  std::vector<std::pair<int, uint64_t>> client;  // under way, by id
  std::vector<uint64_t> ground;
  uint64_t made = 0;
  uint64_t last = 0;
  int id = 0;
  bool up = false;
  for (int i = 0; i < 200'000 || outbox.size() > 0; ++i) {
    if (i < 200'000 && random.next() % 4 == 0) outbox.stored(++made);
    if (random.next() % 20 == 0) {
      up = !up;
      if (up) {
        outbox.connected();
        for (const auto& [again, sequence] : client) ground.push_back(sequence);
      } else {
        outbox.disconnected();
      }
    }
    while (const auto sequence = outbox.next()) {
      outbox.published(++id);
      client.emplace_back(id, *sequence);
      ground.push_back(*sequence);
    }
    if (up && !client.empty() && random.next() % 2 == 0) {
      ASSERT_EQ(outbox.delivered(client.front().first), client.front().second);
      client.erase(client.begin());
    }
  }
  for (const uint64_t sequence : ground) {
    ASSERT_LE(sequence, last + 1);
    last = std::max(last, sequence);
  }
  EXPECT_EQ(last, made);
}

}  // namespace
}  // namespace railfix::tpr_publisher
