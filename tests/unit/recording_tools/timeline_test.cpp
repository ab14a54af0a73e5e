#include "replay/timeline.hpp"

#include <gtest/gtest.h>

namespace railfix::tool {
namespace {

TEST(Timeline, StandsUntilPlayed) {
  Timeline timeline(1000, 2);
  EXPECT_EQ(timeline.at_ns(50), 1000);
  timeline.play(100);
  EXPECT_EQ(timeline.at_ns(150), 1100);
  EXPECT_EQ(timeline.due_ns(1100), 150);
}

TEST(Timeline, GoesOnWhereItWasPaused) {
  Timeline timeline(0, 1);
  timeline.play(100);
  timeline.pause(130);
  EXPECT_EQ(timeline.at_ns(900), 30);
  timeline.play(1000);
  EXPECT_EQ(timeline.due_ns(40), 1010);
}

TEST(Timeline, AnotherRateCountsFromNow) {
  Timeline timeline(0, 1);
  timeline.play(0);
  timeline.set_rate(10, 50);
  EXPECT_EQ(timeline.at_ns(50), 50);
  EXPECT_EQ(timeline.due_ns(150), 60);
  timeline.set_rate(0.5, 60);
  EXPECT_EQ(timeline.at_ns(64), 152);
}

TEST(Timeline, IsMovedWhilePlayingAndWhilePaused) {
  Timeline timeline(0, 1);
  timeline.play(0);
  timeline.seek(500, 10);
  EXPECT_EQ(timeline.at_ns(10), 500);
  EXPECT_EQ(timeline.due_ns(520), 30);
  timeline.pause(20);
  timeline.seek(100, 25);
  EXPECT_EQ(timeline.at_ns(70), 100);
}

}  // namespace
}  // namespace railfix::tool
