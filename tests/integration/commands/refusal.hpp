// How a command refuses what it cannot do.
#pragma once

#include <gmock/gmock.h>

#include <algorithm>
#include <string>

#include "support/program.hpp"

namespace railfix {

constexpr double kPatienceS = 30;

/// One sentence, exit code 2, and nothing else.
inline void expect_refusal(const test::Outcome& outcome, const std::string& words) {
  EXPECT_EQ(outcome.exit_code, 2) << outcome.out;
  EXPECT_THAT(outcome.err, testing::HasSubstr(words));
  EXPECT_EQ(std::count(outcome.err.begin(), outcome.err.end(), '\n'), 1) << outcome.err;
  EXPECT_EQ(outcome.out, "");
}

}  // namespace railfix
