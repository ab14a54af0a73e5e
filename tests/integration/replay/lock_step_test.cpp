// Two lock-step replays of one recording through the real fusion and map_matcher give the same positions, byte for
// byte.
#include <gmock/gmock.h>

#include "integration/replay/lock_step_train.hpp"
#include "integration/replay/recorded_ride.hpp"

namespace railfix::lock_step_test {
namespace {

namespace fs = std::filesystem;

constexpr int kDomain = 88;
class LockStepReplay : public ::testing::Test {
 protected:
  void SetUp() override {
    fs::remove_all(folder_);
    fs::create_directories(folder_);
    test::write_map(folder_ / "line.map");
    test::record_ride(folder_ / "ride.mcap");
  }
  void TearDown() override { fs::remove_all(folder_); }

  /// The bytes of all samples, by topic.
  std::map<std::string, std::string> positions(const std::string& train) {
    const std::string map = (folder_ / "line.map").string();
    test::LockStepTrain services(train, kDomain);
    services.start("fusion", {"fusion.map=" + map, "fusion.start=1:100:+"});
    services.start("map-matcher", {"map_matcher.map=" + map});
    services.replay(folder_ / "ride.mcap", "fusion,map_matcher",
                    "train_state is written by a service of now and is left out");
    const auto& ear = services.ear();
    EXPECT_GE(ear.samples().at("train_state"), test::kFrames);
    EXPECT_GE(ear.samples().at("position_fix"), 4U);
    return ear.bytes();
  }

  std::string name_ = "lock-step-" + std::to_string(getpid());
  fs::path folder_ = fs::temp_directory_path() / ("railfix-" + name_);
};

TEST_F(LockStepReplay, GivesTheSamePositionsByteForByte) {
  const auto once = positions(name_ + "-once");
  const auto twice = positions(name_ + "-twice");
  EXPECT_TRUE(once == twice);
}

}  // namespace
}  // namespace railfix::lock_step_test
