#include "ground_link/silence_watch.hpp"

#include <gtest/gtest.h>

namespace railfix::ground_link {
namespace {

using Names = std::vector<std::string>;

TEST(SilenceWatch, TellsEachTrainOnceUntilItIsHeardAgain) {
  SilenceWatch watch(60);
  watch.heard("a", 0);
  watch.heard("b", 30);
  EXPECT_EQ(watch.fell_silent(60), Names{});
  EXPECT_EQ(watch.fell_silent(61), Names{"a"});
  EXPECT_EQ(watch.fell_silent(91), Names{"b"});
  EXPECT_EQ(watch.fell_silent(200), Names{});
  watch.heard("a", 200);
  EXPECT_EQ(watch.fell_silent(261), Names{"a"});
}

TEST(SilenceWatch, WhoCouldNotBeHeardWasNotSilent) {
  SilenceWatch watch(60);
  watch.heard("a", 0);
  watch.restart(100);
  EXPECT_EQ(watch.fell_silent(160), Names{});
  EXPECT_EQ(watch.fell_silent(161), Names{"a"});
}

}  // namespace
}  // namespace railfix::ground_link
