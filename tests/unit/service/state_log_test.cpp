#include "service/state_log.hpp"

#include <gtest/gtest.h>

#include "core/time.hpp"
#include "idl/operation.h"

namespace railfix::service {
namespace {

struct Told {
  StateLog log;
  std::string at(double time_s, uint8_t state, const std::string& reason = "") {
    const auto line = log.follow(state, reason, core::to_ns(100 + time_s));
    return line ? (line->trouble ? "! " : "") + line->text : "";
  }
};

TEST(StateLog, TellsATroubleAndItsEnd) {
  Told told;
  EXPECT_EQ(told.at(0, msg::STATE_READY), "");
  EXPECT_EQ(told.at(1, msg::STATE_DEGRADED, "no wheel_sample for 2 s"), "! degraded: no wheel_sample for 2 s");
  EXPECT_EQ(told.at(20, msg::STATE_DEGRADED, "no wheel_sample for 21 s"), "") << "the same trouble";
  EXPECT_EQ(told.at(21, msg::STATE_FAILED, "the map is gone"), "! failed: the map is gone");
  EXPECT_EQ(told.at(40, msg::STATE_ACTIVE), "well again");
  EXPECT_EQ(told.at(60, msg::STATE_ACTIVE), "");
  EXPECT_EQ(told.at(61, msg::STATE_STOPPED), "");
}

TEST(StateLog, TroublesThatComeAndGoAreALineInTenSeconds) {
  Told told;
  int lines = 0;
  for (int i = 0; i < 30 * 60; ++i) {
    const auto said = told.at(i / 30.0, i % 2 == 0 ? msg::STATE_DEGRADED : msg::STATE_ACTIVE, "no rails");
    lines += said.empty() ? 0 : 1;
  }
  EXPECT_GE(lines, 4);
  EXPECT_LE(lines, 6);
}

// What is over before ten seconds have passed is told when they have.
TEST(StateLog, TheLastStateIsToldInTheEnd) {
  Told told;
  EXPECT_EQ(told.at(0, msg::STATE_DEGRADED, "blind"), "! degraded: blind");
  EXPECT_EQ(told.at(1, msg::STATE_ACTIVE), "");
  EXPECT_EQ(told.at(2, msg::STATE_DEGRADED, "slipping"), "");
  EXPECT_EQ(told.at(3, msg::STATE_ACTIVE), "");
  EXPECT_EQ(told.at(11, msg::STATE_ACTIVE), "well again (3 changes in 11 s)");
}

}  // namespace
}  // namespace railfix::service
