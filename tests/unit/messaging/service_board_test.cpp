#include "messaging/service_board.hpp"

#include <gtest/gtest.h>

#include "core/time.hpp"

namespace railfix::messaging {
namespace {

msg::ServiceStatus status(uint8_t state, const std::string& reason = "", uint32_t pid = 1) {
  msg::ServiceStatus made;
  made.service("odometry");
  made.host("cab");
  made.state(state);
  made.reason(reason);
  made.pid(pid);
  return made;
}

TEST(ServiceBoard, KnowsSinceWhen) {
  ServiceBoard board;
  board.note(status(msg::STATE_ACTIVE), 100);
  board.note(status(msg::STATE_ACTIVE), 200);
  EXPECT_EQ(board.find("odometry")->since_ns, 100);
  board.note(status(msg::STATE_DEGRADED, "no picture"), 300);
  board.note(status(msg::STATE_DEGRADED, "dark picture"), 400);
  EXPECT_EQ(board.find("odometry")->since_ns, 400) << "another reason is another state";
  EXPECT_EQ(board.find("fusion"), nullptr);
}

TEST(ServiceBoard, ForgetsWhoStoppedUnlessItIsNeeded) {
  ServiceBoard board;
  const auto forget = [&](int64_t before_ns, bool needed) {
    board.forget_stopped(before_ns, [&](const auto&) { return needed; });
    return board.find("odometry") == nullptr;
  };
  board.note(status(msg::STATE_ACTIVE), 100);
  EXPECT_FALSE(forget(1000, false)) << "silent is not stopped";
  board.note(status(msg::STATE_STOPPED), 200);
  EXPECT_FALSE(forget(200, false));
  EXPECT_FALSE(forget(1000, true));
  EXPECT_TRUE(forget(1000, false));
}

// Looks as often as the board wants it, from the last look on; true when somebody has fallen silent.
bool look_until(ServiceBoard& board, int64_t from_ns, int64_t until_ns) {
  bool fallen = false;
  for (int64_t at_ns = from_ns; at_ns < until_ns; at_ns += ServiceBoard::kLookNs) {
    fallen = board.note_silence(at_ns) || fallen;
  }
  return board.note_silence(until_ns) || fallen;
}

constexpr int64_t kBegin = 1'700'000'000'000'000'000;
constexpr int64_t kSilentNs = ServiceBoard::kSilentNs;

TEST(ServiceBoard, TellsDeadFromStartedAnew) {
  ServiceBoard board;
  board.note(status(msg::STATE_ACTIVE), kBegin);
  const int64_t dead_ns = kBegin + kSilentNs;
  EXPECT_FALSE(look_until(board, kBegin, dead_ns - 1));
  EXPECT_TRUE(board.find("odometry")->alive);
  EXPECT_TRUE(board.note_silence(dead_ns));
  EXPECT_FALSE(board.note_silence(dead_ns + 1)) << "once";
  EXPECT_FALSE(board.find("odometry")->alive);
  EXPECT_EQ(board.find("odometry")->since_ns, kBegin) << "since its last word";
  board.note(status(msg::STATE_STARTING, "", 2), dead_ns + 2);
  EXPECT_TRUE(board.find("odometry")->alive);
  EXPECT_EQ(board.find("odometry")->since_ns, dead_ns + 2);
  board.note(status(msg::STATE_STOPPED, "", 2), dead_ns + 3);
  look_until(board, dead_ns + 4, dead_ns + 4 + kSilentNs);
  EXPECT_EQ(board.find("odometry")->since_ns, dead_ns + 3) << "stopped, not dead";
}

TEST(ServiceBoard, OfTwoThatAreSwappedTheFirstCountsUntilItHasEnded) {
  ServiceBoard board;
  int64_t now_ns = kBegin;
  board.note(status(msg::STATE_ACTIVE, "", 1), now_ns);
  for (int i = 0; i < 8; ++i) {
    board.note(status(msg::STATE_READY, "stands by", 2), now_ns += 100'000'000);
    EXPECT_EQ(board.find("odometry")->status.state(), msg::STATE_ACTIVE);
    board.note(status(msg::STATE_ACTIVE, "", 1), now_ns += 100'000'000);
  }
  EXPECT_EQ(board.find("odometry")->since_ns, kBegin) << "nothing has changed";
  board.note(status(msg::STATE_STOPPED, "", 1), now_ns);
  board.note(status(msg::STATE_ACTIVE, "", 2), now_ns);
  EXPECT_EQ(board.find("odometry")->status.pid(), 2U);
  // One that was killed has said nothing of its end.
  board.note(status(msg::STATE_STARTING, "", 3), now_ns + kSilentNs);
  EXPECT_EQ(board.find("odometry")->status.pid(), 3U);
}

// In its container every service is process 2.
TEST(ServiceBoard, OfTwoThatAreSwappedInContainersTheFirstCountsToo) {
  ServiceBoard board;
  int64_t now_ns = kBegin;
  board.note(status(msg::STATE_ACTIVE, "", 2), now_ns, 11);
  for (int i = 0; i < 8; ++i) {
    board.note(status(msg::STATE_READY, "stands by", 2), now_ns += 100'000'000, 12);
    EXPECT_EQ(board.find("odometry")->status.state(), msg::STATE_ACTIVE);
    board.note(status(msg::STATE_ACTIVE, "", 2), now_ns += 100'000'000, 11);
  }
  EXPECT_EQ(board.find("odometry")->since_ns, kBegin) << "nothing has changed";
  board.note(status(msg::STATE_STOPPED, "", 2), now_ns, 11);
  board.note(status(msg::STATE_DEGRADED, "no picture", 2), now_ns, 12);
  EXPECT_EQ(board.find("odometry")->status.state(), msg::STATE_DEGRADED);
}

TEST(ServiceBoard, NobodyIsSilentBecauseTheListenerWasHeldUp) {
  ServiceBoard board;
  board.note_silence(kBegin);
  board.note(status(msg::STATE_ACTIVE), kBegin);
  EXPECT_FALSE(board.note_silence(kBegin + 2 * kSilentNs)) << "held up, or the clock was set";
  board.note_silence(kBegin - kSilentNs);
  EXPECT_FALSE(board.note_silence(kBegin - kSilentNs + ServiceBoard::kLookNs)) << "the clock was set back";
  EXPECT_TRUE(board.find("odometry")->alive);
}

TEST(ServiceBoard, WhoComesByAllTheTimeLooksNowAndThen) {
  ServiceBoard board;
  board.note(status(msg::STATE_ACTIVE), kBegin);
  for (int64_t at_ns = kBegin; at_ns < kBegin + kSilentNs; at_ns += 1'000'000)
    EXPECT_FALSE(board.note_silence_now_and_then(at_ns));
  int64_t told_ns = kBegin + kSilentNs;
  while (!board.note_silence_now_and_then(told_ns) && told_ns < kBegin + 2 * kSilentNs) told_ns += 1'000'000;
  EXPECT_LE(told_ns, kBegin + kSilentNs + ServiceBoard::kLookNs);
  board.note_silence_now_and_then(told_ns + 2 * kSilentNs);
  board.note(status(msg::STATE_ACTIVE), told_ns + 1);
  EXPECT_FALSE(board.note_silence_now_and_then(told_ns + 2 * kSilentNs + 1))
      << "what has come meanwhile is handled first";
}

TEST(ServiceBoard, WhoComesByJustBeforeItIsTimeHearsOfTheSilence) {
  ServiceBoard board;
  board.note(status(msg::STATE_ACTIVE), kBegin);
  constexpr int64_t kEveryNs = ServiceBoard::kLookNs - 20'000'000;
  int64_t at_ns = kBegin;
  while (!board.note_silence_now_and_then(at_ns) && at_ns < kBegin + 4 * kSilentNs) at_ns += kEveryNs;
  EXPECT_LE(at_ns, kBegin + kSilentNs + 2 * kEveryNs);
}

TEST(ServiceBoard, NobodyIsSilentWhileAPlayerSpeaksForAll) {
  ServiceBoard board;
  board.note(status(msg::STATE_ACTIVE), kBegin);
  board.note_player(kBegin);
  EXPECT_FALSE(look_until(board, kBegin, kBegin + 4 * core::kNsPerSecond));
  EXPECT_TRUE(look_until(board, kBegin + 4 * core::kNsPerSecond, kBegin + 6 * core::kNsPerSecond));
}

}  // namespace
}  // namespace railfix::messaging
