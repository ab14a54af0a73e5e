#include "frame_grabber/pace.hpp"

#include <gtest/gtest.h>

namespace railfix::frame_grabber {
namespace {

// Data:  100   110   120   130        Wall when asked:  5000 is the first picture
TEST(RealPace, PicturesAreAsFarApartAsTheyWereRecorded) {
  RealPace pace;
  EXPECT_EQ(pace.ask(100, 5000).due_ns, 5000);
  EXPECT_EQ(pace.ask(110, 5001).due_ns, 5010);
  EXPECT_EQ(pace.ask(130, 5001).due_ns, 5030);
}

TEST(RealPace, ThreePeriodsLateIsPlayedMoreIsSkippedAndDoesNotShiftTheRest) {
  RealPace pace;
  EXPECT_FALSE(pace.ask(100, 5000).skip);
  EXPECT_FALSE(pace.ask(110, 5040).skip);  // due 5010, exactly three periods late
  EXPECT_TRUE(pace.ask(120, 5051).skip);   // due 5020
  const auto next = pace.ask(130, 5051);   // due 5030
  EXPECT_FALSE(next.skip);
  EXPECT_EQ(next.due_ns, 5030);
}

TEST(RealPace, WhereTheBeginningIsSaidTheFirstPictureIsDueThen) {
  RealPace pace(4900);
  EXPECT_EQ(pace.ask(100, 4000).due_ns, 5000);
  EXPECT_EQ(pace.ask(110, 5001).due_ns, 5010);
}

TEST(RealPace, PicturesOutOfOrderAreDueAtOnce) {
  RealPace pace;
  (void)pace.ask(100, 5000);
  (void)pace.ask(120, 5010);
  const auto old = pace.ask(110, 5021);
  EXPECT_FALSE(old.skip);
  EXPECT_EQ(old.due_ns, 5021);
  EXPECT_EQ(pace.ask(140, 5021).due_ns, 5040);
}

TEST(LockStep, GivesEveryoneATurnInOrderAndNamesWhoHasIt) {
  LockStep step({"odometry", "fusion"});
  EXPECT_TRUE(step.done());
  step.begin();
  EXPECT_EQ(step.step(), 1U);
  EXPECT_EQ(step.turn(), "odometry");
  EXPECT_FALSE(step.answered("fusion", 1)) << "not yet its turn";
  EXPECT_FALSE(step.answered("stranger", 1));
  EXPECT_TRUE(step.answered("odometry", 1));
  EXPECT_EQ(step.turn(), "fusion");
  EXPECT_FALSE(step.answered("odometry", 1)) << "twice";
  EXPECT_TRUE(step.answered("fusion", 1));
  EXPECT_TRUE(step.done());
  EXPECT_FALSE(step.answered("fusion", 1)) << "no turn is left";
  step.begin();
  EXPECT_FALSE(step.answered("odometry", 1)) << "of the step before";
  EXPECT_EQ(step.turn(), "odometry");
}

TEST(Gathering, IsCompleteWhenEveryoneHasFoundEveryone) {
  Gathering gathering({"odometry", "fusion"});
  // 4 endpoints there; 3 pairs are 6 matches, of which 2 are here.
  const messaging::Connections found{0, 2, 4, 3};
  EXPECT_FALSE(gathering.complete(found));
  gathering.heard("odometry", {2, 2});
  EXPECT_FALSE(gathering.complete(found)) << "fusion is not there";
  gathering.heard("fusion", {2, 1});
  EXPECT_FALSE(gathering.complete(found)) << "fusion has not found all";
  gathering.heard("fusion", {2, 2});
  EXPECT_TRUE(gathering.complete(found));
  EXPECT_FALSE(gathering.complete({0, 2, 5, 3})) << "one more has come";
}

TEST(Gathering, IsNotHeldUpByProgramsWithoutAStatus) {
  Gathering gathering({"odometry"});
  const messaging::Connections found{0, 2, 9, 7};
  int looks = 0;
  for (; looks < 100; ++looks) EXPECT_FALSE(gathering.complete(found)) << "nobody is there";
  gathering.heard("odometry", {2, 2});
  for (looks = 0; looks < 100 && !gathering.complete(found); ++looks) {
  }
  EXPECT_GT(looks, 10);
  EXPECT_LT(looks, 30);
}

TEST(LockStep, NobodyToWaitForIsDone) {
  LockStep step({});
  step.begin();
  EXPECT_TRUE(step.done());
}

}  // namespace
}  // namespace railfix::frame_grabber
