#include "service/restarts.hpp"

#include <gtest/gtest.h>

#include "core/time.hpp"

namespace railfix::service {
namespace {

constexpr int64_t kS = core::kNsPerSecond;
constexpr uint64_t kPlayer = 1;
constexpr uint64_t kOther = 2;

msg::DataClock clock(uint64_t seq, int64_t data_ns, int64_t wall_ns = 0, bool lock_step = false) {
  msg::DataClock made;
  made.seq(seq);
  made.data_ns(data_ns);
  made.wall_ns(wall_ns);
  made.lock_step(lock_step ? 1 : 0);
  return made;
}

TEST(Restarts, DataThatRunsOnIsNone) {
  Restarts restarts;
  for (uint64_t seq = 1; seq < 100; ++seq) {
    EXPECT_FALSE(restarts.heard(clock(seq, static_cast<int64_t>(seq) * kS / 10), kPlayer, 0)) << seq;
  }
  EXPECT_FALSE(restarts.heard(clock(100, 9 * kS), kPlayer, 0)) << "a picture of an older stamp";
  EXPECT_FALSE(restarts.outdated(0, 0));
}

TEST(Restarts, AnyMoveIsOne) {
  Restarts restarts;
  restarts.heard(clock(1, 100 * kS), kPlayer, 0);
  restarts.heard(clock(2, 101 * kS), kPlayer, 0);
  EXPECT_TRUE(restarts.heard(clock(1, 50 * kS), kPlayer, 0)) << "back";
  EXPECT_TRUE(restarts.heard(clock(1, 90 * kS), kPlayer, 0)) << "and at once forward";
  EXPECT_FALSE(restarts.heard(clock(2, 90 * kS), kPlayer, 0));
}

TEST(Restarts, LeavesOutWhatWasUnderWay) {
  Restarts restarts;
  restarts.heard(clock(7, 101 * kS), kPlayer, 0);
  restarts.heard(clock(1, 50 * kS), kPlayer, 10 * kS);
  EXPECT_TRUE(restarts.outdated(101 * kS - 1, 10 * kS));
  EXPECT_FALSE(restarts.outdated(50 * kS + 1, 10 * kS));
  EXPECT_FALSE(restarts.outdated(0, 10 * kS)) << "says no time";
  restarts.heard(clock(2, 100 * kS), kPlayer, 10 * kS);
  EXPECT_FALSE(restarts.outdated(100 * kS, 10 * kS)) << "played so fast that it is there again";
  EXPECT_FALSE(restarts.outdated(101 * kS, 12 * kS)) << "nothing is under way for so long";
}

TEST(Restarts, AnotherPlayerIsOneWhenItPlaysSomethingElse) {
  Restarts restarts;
  restarts.heard(clock(500, 100 * kS, 1000 * kS), kPlayer, 0);
  EXPECT_FALSE(restarts.heard(clock(480, 102 * kS, 1001 * kS), kOther, 0)) << "cameras and sensors of one recording";
  EXPECT_FALSE(restarts.heard(clock(501, 102 * kS, 1002 * kS), kPlayer, 0));
  EXPECT_TRUE(restarts.heard(clock(600, 900 * kS, 1003 * kS), kOther, 0));
}

TEST(Restarts, InLockStepEveryTurnHasItsStepsNumber) {
  Restarts restarts;
  for (uint64_t step = 1; step < 5; ++step) {
    for (int turn = 0; turn < 3; ++turn) {
      EXPECT_FALSE(restarts.heard(clock(step, static_cast<int64_t>(step) * kS, 0, true), kPlayer, 0));
    }
  }
  EXPECT_TRUE(restarts.heard(clock(1, kS / 2, 0, true), kPlayer, 0));
  EXPECT_TRUE(restarts.outdated(4 * kS, 1000 * kS)) << "no time runs in lock step";
  EXPECT_TRUE(restarts.heard(clock(1, 3 * kS, 0, true), kPlayer, 0)) << "moved again before the second step";
  restarts.heard(clock(3, 3 * kS, 0, true), kPlayer, 0);
  EXPECT_FALSE(restarts.outdated(kS / 2, 0));
}

}  // namespace
}  // namespace railfix::service
