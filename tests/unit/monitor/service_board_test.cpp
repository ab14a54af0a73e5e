#include "monitor/service_board.hpp"

#include <gtest/gtest.h>

namespace railfix::monitor {
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

TEST(ServiceBoard, TellsDeadFromStartedAnew) {
  constexpr int64_t kSilentNs = ServiceBoard::kSilentNs;
  ServiceBoard board;
  board.note(status(msg::STATE_ACTIVE), 100);
  board.note(status(msg::STATE_ACTIVE), 200);
  EXPECT_FALSE(board.note_silence(199 + kSilentNs));
  EXPECT_TRUE(board.find("odometry")->alive);
  EXPECT_TRUE(board.note_silence(200 + kSilentNs));
  EXPECT_FALSE(board.note_silence(201 + kSilentNs)) << "once";
  EXPECT_FALSE(board.find("odometry")->alive);
  EXPECT_EQ(board.find("odometry")->since_ns, 200) << "since its last word";
  board.note(status(msg::STATE_STARTING, "", 2), 300 + kSilentNs);
  EXPECT_TRUE(board.find("odometry")->alive);
  EXPECT_EQ(board.find("odometry")->since_ns, 300 + kSilentNs);
  board.note(status(msg::STATE_STOPPED, "", 2), 400 + kSilentNs);
  board.note_silence(400 + 2 * kSilentNs);
  EXPECT_EQ(board.find("odometry")->since_ns, 400 + kSilentNs) << "stopped, not dead";
}

}  // namespace
}  // namespace railfix::monitor
