#include "service/turns.hpp"

#include <gmock/gmock.h>

namespace railfix::service {
namespace {

using ::testing::ElementsAre;

class TurnsTest : public ::testing::Test {
 protected:
  TurnsTest() {
    turns_.reads("wheel_sample");
    turns_.reads("odometry_step");
  }
  void come(const std::string& topic, uint64_t sequence, int64_t stamp_ns) {
    turns_.keep(topic, sequence, stamp_ns,
                [this, topic, sequence] { used_.push_back(topic + " " + std::to_string(sequence)); });
  }
  std::vector<std::string> use() {
    used_.clear();
    for (const auto& work : turns_.take()) work();
    return used_;
  }
  Turns turns_;
  std::vector<std::string> used_;
};

TEST_F(TurnsTest, WaitsForEverySampleThatWasSent) {
  come("odometry_step", 1, 100);
  turns_.begin({{"wheel_sample", 2}, {"odometry_step", 1}, {"track_view", 7}});
  EXPECT_FALSE(turns_.ready());
  come("wheel_sample", 1, 50);
  EXPECT_FALSE(turns_.ready());
  come("wheel_sample", 2, 100);
  EXPECT_TRUE(turns_.ready());
}

TEST_F(TurnsTest, UsesThemByStampThenTopicThenSequenceHoweverTheyCame) {
  come("odometry_step", 1, 100);
  come("wheel_sample", 2, 100);
  come("wheel_sample", 3, 100);
  come("wheel_sample", 1, 50);
  turns_.begin({});
  ASSERT_TRUE(turns_.ready());
  EXPECT_THAT(use(), ElementsAre("wheel_sample 1", "wheel_sample 2", "wheel_sample 3", "odometry_step 1"));
  EXPECT_TRUE(use().empty());
}

TEST_F(TurnsTest, SamplesOfTheNextStepMayComeEarlyAndStillCount) {
  turns_.begin({{"wheel_sample", 1}});
  come("wheel_sample", 1, 50);
  ASSERT_TRUE(turns_.ready());
  EXPECT_THAT(use(), ElementsAre("wheel_sample 1"));
  come("wheel_sample", 2, 60);
  turns_.begin({{"wheel_sample", 2}, {"odometry_step", 1}});
  EXPECT_FALSE(turns_.ready());
  come("odometry_step", 1, 60);
  EXPECT_TRUE(turns_.ready());
}

}  // namespace
}  // namespace railfix::service
