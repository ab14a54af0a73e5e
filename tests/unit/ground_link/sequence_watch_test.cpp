#include "ground_link/sequence_watch.hpp"

#include <gtest/gtest.h>

namespace railfix::ground_link {
namespace {

TEST(SequenceWatch, TellsNewFromOld) {
  SequenceWatch watch;
  EXPECT_EQ(watch.arrived("a", 1, 5), Arrival::fresh);  // joined late: nothing is missing
  EXPECT_EQ(watch.arrived("a", 1, 6), Arrival::fresh);
  EXPECT_EQ(watch.arrived("a", 1, 6), Arrival::twice);
  EXPECT_EQ(watch.arrived("a", 1, 3), Arrival::twice);
  EXPECT_EQ(watch.arrived("a", 1, 9), Arrival::gap);
  EXPECT_EQ(watch.missing(), 2U);
  EXPECT_EQ(watch.arrived("a", 1, 7), Arrival::filled);
  EXPECT_EQ(watch.arrived("a", 1, 7), Arrival::twice);
  EXPECT_EQ(watch.arrived("a", 1, 10), Arrival::fresh);
  EXPECT_EQ(watch.missing(), 1U);
}

TEST(SequenceWatch, KeepsTrainsAndStreamsApart) {
  SequenceWatch watch;
  EXPECT_EQ(watch.arrived("a", 1, 5), Arrival::fresh);
  EXPECT_EQ(watch.arrived("b", 1, 5), Arrival::fresh);
  EXPECT_EQ(watch.arrived("a", 2, 1), Arrival::fresh);
  EXPECT_EQ(watch.arrived("a", 1, 6), Arrival::fresh);
  EXPECT_EQ(watch.missing(), 0U);
}

TEST(SequenceWatch, AJumpOfALyingSenderTakesNoEndlessMemory) {
  SequenceWatch watch;
  watch.arrived("a", 1, 0);
  EXPECT_EQ(watch.arrived("a", 1, UINT64_MAX), Arrival::gap);
  EXPECT_LE(watch.missing(), 100'000U);
  EXPECT_EQ(watch.arrived("a", 1, UINT64_MAX), Arrival::twice);
}

}  // namespace
}  // namespace railfix::ground_link
