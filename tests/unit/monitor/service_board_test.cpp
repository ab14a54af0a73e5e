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
  ServiceBoard board;
  board.note(status(msg::STATE_ACTIVE), 100);
  board.note_silent(status(msg::STATE_ACTIVE), 200);
  EXPECT_FALSE(board.find("odometry")->alive);
  EXPECT_EQ(board.find("odometry")->since_ns, 200);
  board.note(status(msg::STATE_STARTING, "", 2), 300);
  EXPECT_TRUE(board.find("odometry")->alive);
  board.note_silent(status(msg::STATE_ACTIVE, "", 1), 400);
  EXPECT_TRUE(board.find("odometry")->alive) << "the old program's lease ran out, the new one lives";
}

}  // namespace
}  // namespace railfix::monitor
