// Two lock-step replays of a recording with pictures give the same positions, byte for byte: pictures out of the
// recording go through the real track_detector, odometry, map_matcher and fusion.
#include <gmock/gmock.h>

#include "integration/replay/lock_step_ear.hpp"
#include "support/program.hpp"

namespace railfix {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

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
    std::vector<std::unique_ptr<test::Program>> services;
    const auto start = [&](const std::string& name, std::vector<std::string> settings) {
      settings.insert(settings.end(), {"common.train_id=" + train, "common.domain=" + std::to_string(kDomain),
                                       "common.log_level=error", "common.lock_step=true"});
      services.push_back(std::make_unique<test::Program>(test::with_settings("railfix-" + name, settings)));
    };
    const std::string map = fs::path(sequence()) / "map" / "line.map";
    start("track-detector", {});
    start("odometry", {});
    start("map-matcher", {"map_matcher.map=" + map});
    start("fusion", {"fusion.map=" + map, "fusion.start=1:250:+"});
    test::LockStepEar ear(train, kDomain);
    test::Program replay({"railfix", "replay", (folder_ / "run" / "recording.mcap").string(), "--lock-step",
                          "track_detector,odometry,map_matcher,fusion," + test::LockStepEar::kName, "--train", train,
                          "--domain", std::to_string(kDomain)},
                         {folder_ / "out", folder_ / "err", {}});
    EXPECT_TRUE(ear.listen_until_the_end()) << test::slurp(folder_ / "err");
    EXPECT_EQ(replay.wait_for_end(), 0) << test::slurp(folder_ / "err");
    EXPECT_THAT(test::slurp(folder_ / "err"), HasSubstr("odometry_step is written by a service of now"));
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
}  // namespace railfix
