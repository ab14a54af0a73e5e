#include "service/left_out.hpp"

#include <gtest/gtest.h>

namespace railfix::service {
namespace {

TEST(LeftOut, IsCountedByTopicAndReasonAndToldForSomeSeconds) {
  LeftOut left_out;
  EXPECT_EQ(left_out.sentence(0), "");
  left_out.add("track_view", LeftOut::kNoSense, 1'000'000'000);
  left_out.add("odometry_step", LeftOut::kNoSense, 2'000'000'000);
  left_out.add("odometry_step", "too late", 2'500'000'000);
  left_out.add("odometry_step", LeftOut::kNoSense, 3'000'000'000);
  EXPECT_EQ(left_out.sentence(4'000'000'000),
            "2 of odometry_step were left out: their values are no numbers, or such as no train has");
  EXPECT_EQ(left_out.sentence(60'000'000'000), "");
}

}  // namespace
}  // namespace railfix::service
