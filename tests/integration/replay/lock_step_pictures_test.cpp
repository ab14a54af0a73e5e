// Two lock-step replays of a recording with pictures give the same positions, byte for byte: pictures out of the
// recording go through the real track_detector, odometry, map_matcher and fusion.
#include <gmock/gmock.h>

#include "integration/replay/lock_step_train.hpp"

namespace railfix::lock_step_pictures_test {
namespace {

namespace fs = std::filesystem;

constexpr int kDomain = 89;
constexpr size_t kLeastPictures = 60;
constexpr double kPatienceS = 240;

class LockStepReplayOfPictures : public ::testing::Test {
 protected:
  void SetUp() override {
    fs::remove_all(folder_);
    fs::create_directories(folder_);
    const auto simulated = test::run_program(
        {"railfix",         "simulate", "--out",        sequence(), "--start",  "1:250", "--length-m",     "60",
         "--speed-kmh",     "60",       "--accelerate", "3",        "--brake",  "3",     "--dwell-s",      "0.5",
         "--rate-hz",       "10",       "--size",       "640x512",  "--format", "jpg",   "--only-ahead-m", "60",
         "--only-beside-m", "4",        "--seed",       "31",       "--quiet"},
        kPatienceS);
    ASSERT_EQ(simulated.exit_code, 0) << simulated.err;
    const auto ran = test::run_program({"railfix", "run", "--dataset", sequence(), "--start", "1:250:+", "--out",
                                        (folder_ / "run").string(), "--domain", std::to_string(kDomain)},
                                       kPatienceS);
    ASSERT_EQ(ran.exit_code, 0) << ran.err << ran.out;
  }
  void TearDown() override { fs::remove_all(folder_); }
  [[nodiscard]] std::string sequence() const { return (folder_ / "seq").string(); }

  /// The bytes of all samples, by topic.
  std::map<std::string, std::string> positions(const std::string& train) {
    const std::string map = fs::path(sequence()) / "map" / "line.map";
    test::LockStepTrain services(train, kDomain);
    services.start("track-detector", {});
    services.start("odometry", {});
    services.start("map-matcher", {"map_matcher.map=" + map});
    services.start("fusion", {"fusion.map=" + map, "fusion.start=1:250:+"});
    services.replay(folder_ / "run" / "recording.mcap", "track_detector,odometry,map_matcher,fusion",
                    "odometry_step is written by a service of now");
    const auto& ear = services.ear();
    EXPECT_GE(ear.samples().at("train_state"), kLeastPictures);
    return ear.bytes();
  }

  std::string name_ = "lock-step-pictures-" + std::to_string(getpid());
  fs::path folder_ = fs::temp_directory_path() / ("railfix-" + name_);
};

TEST_F(LockStepReplayOfPictures, GivesTheSamePositionsByteForByte) {
  const auto once = positions(name_ + "-once");
  const auto twice = positions(name_ + "-twice");
  EXPECT_TRUE(once == twice);
}

}  // namespace
}  // namespace railfix::lock_step_pictures_test
