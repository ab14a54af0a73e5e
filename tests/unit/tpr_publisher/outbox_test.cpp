#include "tpr_publisher/ground_link/outbox.hpp"

#include <gmock/gmock.h>

#include "core/random.hpp"

namespace railfix::tpr_publisher {
namespace {

using ::testing::ElementsAre;

/// With reports 1, 2, ... `count` stored, and the connection proven by an earlier one.
Outbox connected_outbox(size_t most_under_way, uint64_t count) {
  Outbox outbox(most_under_way);
  outbox.connected();
  outbox.published_unstored(1);
  outbox.delivered(1);
  for (uint64_t sequence = 1; sequence <= count; ++sequence) outbox.stored(sequence);
  return outbox;
}

TEST(Outbox, SendsInOrderAndOnlySoManyAtATime) {
  Outbox outbox(2);
  for (const uint64_t sequence : {6U, 7U, 8U, 9U}) outbox.stored(sequence);
  EXPECT_FALSE(outbox.next().has_value());  // not connected
  outbox.connected();
  EXPECT_EQ(outbox.next(), 6U);
  outbox.published(100);
  EXPECT_FALSE(outbox.next().has_value()) << "the first one of a connection goes alone";
  EXPECT_EQ(outbox.delivered(100), 6U);
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

TEST(Outbox, WhatALostConnectionHadUnderWayWaitsInItsPlaceAgain) {
  auto outbox = connected_outbox(5, 3);
  outbox.published(11);
  outbox.published(12);
  EXPECT_EQ(outbox.delivered(12), 2U);
  outbox.disconnected();
  EXPECT_FALSE(outbox.next().has_value());
  EXPECT_EQ(outbox.size(), 2U);
  outbox.connected();
  EXPECT_EQ(outbox.next(), 1U);
  outbox.published(13);
  EXPECT_FALSE(outbox.next().has_value()) << "alone";
  EXPECT_EQ(outbox.delivered(11), std::nullopt) << "of the connection before";
  EXPECT_EQ(outbox.delivered(13), 1U);
  EXPECT_EQ(outbox.next(), 3U);
}

TEST(Outbox, WhatIsNotStoredGoesBehindWhatIs) {
  Outbox outbox(2);
  EXPECT_FALSE(outbox.takes_unstored(UINT64_MAX));  // not connected
  outbox.stored(7);
  outbox.connected();
  EXPECT_FALSE(outbox.takes_unstored(UINT64_MAX));
  outbox.published(101);
  EXPECT_FALSE(outbox.takes_unstored(UINT64_MAX)) << "7 goes alone";
  EXPECT_EQ(outbox.delivered(101), 7U);
  outbox.published_unstored(102);
  EXPECT_TRUE(outbox.takes_unstored(UINT64_MAX));
  outbox.published_unstored(103);
  EXPECT_FALSE(outbox.takes_unstored(UINT64_MAX)) << "two are under way";
  outbox.disconnected();
  EXPECT_EQ(outbox.size(), 0U) << "its owner keeps it";
  outbox.connected();
  EXPECT_TRUE(outbox.takes_unstored(UINT64_MAX));
}

TEST(Outbox, WhatIsNotStoredGoesBeforeWhatIsStoredSince) {
  Outbox outbox(1);
  outbox.connected();
  outbox.stored(7);
  outbox.published(101);
  EXPECT_EQ(outbox.delivered(101), 7U);
  EXPECT_TRUE(outbox.takes_unstored(outbox.newest()));
  outbox.published_unstored(102);
  const uint64_t behind = outbox.newest();
  outbox.stored(8);
  outbox.disconnected();
  outbox.connected();
  EXPECT_EQ(behind, 7U);
  EXPECT_TRUE(outbox.takes_unstored(behind));
  EXPECT_FALSE(outbox.takes_unstored(outbox.newest())) << "8 waits";
}

TEST(Outbox, WhatIsRefusedWaitsInItsPlaceAndGoesAloneUntilItIsTaken) {
  auto outbox = connected_outbox(3, 4);
  for (const int id : {11, 12, 13}) outbox.published(id);
  outbox.refused(11);
  EXPECT_FALSE(outbox.next().has_value()) << "held";
  outbox.refused(12);
  outbox.try_again();
  EXPECT_FALSE(outbox.next().has_value()) << "3 is under way still";
  outbox.refused(13);
  outbox.try_again();
  EXPECT_EQ(outbox.size(), 4U);
  EXPECT_EQ(outbox.next(), 1U);
  outbox.published(14);
  EXPECT_FALSE(outbox.next().has_value()) << "alone";
  outbox.refused(14);
  EXPECT_TRUE(outbox.held());
  outbox.disconnected();
  outbox.connected();
  EXPECT_FALSE(outbox.next().has_value()) << "a broker that ends the connection after a refusal gets its pause, too";
  outbox.try_again();
  EXPECT_EQ(outbox.next(), 1U);
  outbox.published(15);
  EXPECT_EQ(outbox.delivered(15), 1U);
  for (const uint64_t sequence : {2U, 3U, 4U}) {
    EXPECT_EQ(outbox.next(), sequence);
    outbox.published(static_cast<int>(20 + sequence));
  }
}

TEST(Outbox, DropsTheOldestBeyondTheLimit) {
  auto outbox = connected_outbox(1, 6);
  outbox.published(11);
  EXPECT_THAT(outbox.limit(3), ElementsAre(2U, 3U));
  EXPECT_EQ(outbox.delivered(11), 1U);
  EXPECT_EQ(outbox.next(), 4U);
  outbox.skip();
  EXPECT_EQ(outbox.next(), 5U);
}

// A link that breaks at random, and a broker that refuses everything at times and ends the connection then: what it has
// not answered by then it may have or not.
TEST(Outbox, OverABadLinkEverythingArrivesInOrderOrTwice) {
  core::Random random(4);
  Outbox outbox(4);
  std::vector<std::pair<int, uint64_t>> broker;  // on the way to it, by id
  std::vector<uint64_t> ground;
  uint64_t made = 0;
  int id = 0;
  bool up = false;
  bool refuses = false;
  const auto cut = [&] {
    const size_t taken = refuses ? 0 : random.next() % (broker.size() + 1);
    for (size_t i = 0; i < taken; ++i) ground.push_back(broker[i].second);
    broker.clear();
    outbox.disconnected();
    up = false;
  };
  for (int i = 0; i < 200'000 || outbox.size() > 0; ++i) {
    if (i < 200'000 && random.next() % 4 == 0) outbox.stored(++made);
    if (random.next() % 50 == 0) refuses = i < 200'000 && !refuses;
    if (random.next() % 20 == 0) {
      if (up) {
        cut();
      } else {
        outbox.connected();
        up = true;
      }
    }
    if (random.next() % 5 == 0) outbox.try_again();
    while (const auto sequence = outbox.next()) {
      outbox.published(++id);
      broker.emplace_back(id, *sequence);
    }
    if (!up || broker.empty() || random.next() % 2 == 0) continue;
    if (refuses) {
      outbox.refused(broker.front().first);
      cut();
    } else {
      ground.push_back(broker.front().second);
      ASSERT_EQ(outbox.delivered(broker.front().first), broker.front().second);
      broker.erase(broker.begin());
    }
  }
  uint64_t last = 0;
  for (const uint64_t sequence : ground) {
    ASSERT_LE(sequence, last + 1);
    last = std::max(last, sequence);
  }
  EXPECT_EQ(last, made);
}

}  // namespace
}  // namespace railfix::tpr_publisher
