// What the recorder does where no file can be begun, or the open one goes: full disks, files that are there or removed.
#include <gmock/gmock.h>

#include <fstream>

#include "mcap/reader.hpp"
#include "recorder_fixture.hpp"

namespace railfix::recorder {

namespace {

using ::testing::HasSubstr;

TEST_F(RecorderTest, AFileThatIsRemovedIsSaidAndItGoesOnInANewFile) {
  messaging::Writer<msg::CameraCalibration> calibration(participant_, topics::camera_calibration);
  ASSERT_TRUE(calibration.write({}));
  auto recorder = this->recorder();
  const auto started = recorder->start((folder_ / "ride.mcap").string());
  ASSERT_TRUE(started.ok());
  ASSERT_TRUE(wait_until([&] { return recorder->state().written == 1; }));
  fs::remove_all(folder_);
  ASSERT_TRUE(wait_until([&] { return recorder->state().recording && recorder->state().file != started.value(); }))
      << recorder->state().problem;
  std::string said;
  for (const auto& news : recorder->take_state().news) said += news.sentence + "\n";
  EXPECT_THAT(said, HasSubstr("ride.mcap.active was removed while it was being recorded"));
  EXPECT_THAT(said, HasSubstr("recording goes on in " + recorder->state().file));
  ASSERT_TRUE(wait_until([&] { return recorder->state().messages == 1; })) << "standing values are in it";
  EXPECT_TRUE(recorder->stop().ok());
}

// The command comes before, while and after the thread leaves the file by itself.
TEST_F(RecorderTest, ACommandWaitsForWhatTheThreadDoesByItself) {
  auto recorder = this->recorder();
  for (int i = 0; i < 12; ++i) {
    const auto started = recorder->start("");
    ASSERT_TRUE(started.ok()) << started.error().message;
    fs::remove(started.value() + kActive);
    ::usleep(static_cast<useconds_t>(i) * 25'000);
    (void)recorder->stop();
    ASSERT_TRUE(wait_until([&] { return !recorder->state().recording || recorder->stop().ok(); }));
    EXPECT_EQ(recorder->state().failure, "");
  }
}

TEST_F(RecorderTest, AFullDiskIsRefusedAndLeavesNoFile) {
  config_.keep_free_mb = 1e12;
  auto recorder = this->recorder();
  const auto started = recorder->start("");
  ASSERT_FALSE(started.ok());
  EXPECT_THAT(started.error().message, HasSubstr("MB free; goes on in a new file when "));
  EXPECT_TRUE(recorder->state().goes_on_by_itself);
  EXPECT_FALSE(recorder->state().recording);
  EXPECT_FALSE(fs::exists(folder_));
  EXPECT_TRUE(recorder->stop().ok()) << "does not wait any more";
  EXPECT_FALSE(recorder->state().goes_on_by_itself);
}

TEST_F(RecorderTest, GoesOnByItselfWhenThereIsRoomAgain) {
  config_.keep_free_mb = 5;
  std::atomic<uint64_t> free_mb = 20;
  free_space_ = [&](const fs::path&) { return free_mb * 1'000'000; };
  auto recorder = this->recorder();
  const auto started = recorder->start("");
  ASSERT_TRUE(started.ok());
  free_mb = 4;
  ASSERT_TRUE(wait_until([&] { return !recorder->state().recording; }));
  EXPECT_TRUE(mcap::Reader::open(started.value()).value()->indexed()) << "it is closed properly";
  EXPECT_THAT(recorder->state().problem, HasSubstr("recording stopped: the disk of " + started.value() +
                                                   " has less than 5 MB free; goes on in a new file when 10 MB"));
  free_mb = 9;
  ::usleep(600'000);
  EXPECT_FALSE(recorder->state().recording) << "it would be full again at once";
  free_mb = 11;
  ASSERT_TRUE(wait_until([&] { return recorder->state().recording; }));
  EXPECT_EQ(recorder->state().problem, "");
  free_mb = 4;
  ASSERT_TRUE(wait_until([&] { return !recorder->state().recording; }));
  EXPECT_TRUE(recorder->stop().ok()) << "does not begin again";
  EXPECT_EQ(recorder->state().problem, "");
}

TEST_F(RecorderTest, AFileThatIsRemovedFromADiskThatHasLittleRoomIsFollowedByANewOne) {
  config_.keep_free_mb = 5;
  std::atomic<uint64_t> free_mb = 7;
  free_space_ = [&](const fs::path&) { return free_mb * 1'000'000; };
  auto recorder = this->recorder();
  const auto first = recorder->start((folder_ / "ride.mcap").string());
  ASSERT_TRUE(first.ok());
  const auto next_file = [&] { return recorder->state().recording ? recorder->state().file : ""; };
  fs::remove(first.value() + kActive);
  ASSERT_TRUE(wait_until([&] { return !next_file().empty() && next_file() != first.value(); }))
      << recorder->state().problem;
  EXPECT_EQ(recorder->state().problem, "");
  free_mb = 4;
  ASSERT_TRUE(wait_until([&] { return !recorder->state().recording; }));
  EXPECT_TRUE(recorder->state().goes_on_by_itself);
}

// A stick, and the disk of the recordings that has room.
TEST_F(RecorderTest, AFileOnAFullDiskThatSomebodyNamesIsRefusedAndNothingElseIsBegun) {
  config_.keep_free_mb = 5;
  const fs::path stick = folder_ / "stick";
  fs::create_directories(stick);
  free_space_ = [&](const fs::path& folder) { return folder == stick ? uint64_t{0} : uint64_t{1'000'000'000}; };
  auto recorder = this->recorder();
  const auto started = recorder->start(stick / "x.mcap");
  ASSERT_FALSE(started.ok());
  EXPECT_THAT(started.error().message, HasSubstr("x.mcap has less than 5 MB free; make room there"));
  ::usleep(600'000);
  EXPECT_FALSE(recorder->state().recording) << recorder->state().file;
  EXPECT_FALSE(recorder->state().goes_on_by_itself);
}

TEST_F(RecorderTest, TheConfiguredFileIsTheOneThatComesWhenAFullDiskHasRoom) {
  config_.file = (folder_ / "run.mcap").string();
  config_.keep_free_mb = 5;
  fs::create_directories(folder_);
  std::ofstream(config_.file + kActive) << "of a crash";
  std::atomic<uint64_t> free_mb = 4;
  free_space_ = [&](const fs::path&) { return free_mb * 1'000'000; };
  auto recorder = this->recorder();
  ASSERT_FALSE(recorder->start("").ok());
  EXPECT_TRUE(fs::exists(config_.file + kActive)) << "nothing is begun";
  free_mb = 11;
  ASSERT_TRUE(wait_until([&] { return recorder->state().recording; }));
  EXPECT_EQ(recorder->state().file, config_.file);
  EXPECT_TRUE(fs::exists(folder_ / "run-cut-off.mcap.active"));
}

TEST_F(RecorderTest, WhatACrashLeftOfTheConfiguredFileIsPutAside) {
  config_.file = (folder_ / "run.mcap").string();
  fs::create_directories(folder_);
  for (const char* aside : {"run-cut-off.mcap.active", "run-cut-off-2.mcap.active"}) {
    std::ofstream(folder_ / "run.mcap.active") << aside;
    auto recorder = this->recorder();
    ASSERT_TRUE(recorder->start("").ok());
    const auto news = recorder->take_state().news;
    ASSERT_EQ(news.size(), 1U);
    EXPECT_THAT(news[0].sentence, HasSubstr("run.mcap.active was left by a crash and is now "));
    std::string kept;
    std::ifstream(folder_ / aside) >> kept;
    EXPECT_EQ(kept, aside);
    ASSERT_TRUE(recorder->stop().ok());
  }
  EXPECT_TRUE(mcap::Reader::open(config_.file).value()->indexed());
}

TEST_F(RecorderTest, ASecondStartKeepsWhatTheFirstRecorded) {
  config_.file = (folder_ / "run.mcap").string();
  auto recorder = this->recorder();
  for (const char* name : {"run.mcap", "run-2.mcap", "run-3.mcap"}) {
    const auto started = recorder->start("");
    ASSERT_TRUE(started.ok()) << started.error().message;
    EXPECT_EQ(started.value(), folder_ / name);
    ASSERT_TRUE(recorder->stop().ok());
  }
  EXPECT_TRUE(fs::exists(folder_ / "run.mcap"));
}

TEST_F(RecorderTest, WhoeverSaysTheNameOfTheConfiguredFileDoesNotReplaceIt) {
  config_.file = (folder_ / "ride.mcap").string();
  auto recorder = this->recorder();
  EXPECT_EQ(recorder->start("ride").value(), config_.file) << "nothing is there yet";
  ASSERT_TRUE(recorder->stop().ok());
  for (const std::string& name : {std::string("ride"), std::string("ride.mcap"), config_.file}) {
    const auto again = recorder->start(name);
    ASSERT_FALSE(again.ok()) << name;
    EXPECT_THAT(again.error().message, HasSubstr("ride.mcap exists already"));
  }
  EXPECT_EQ(recorder->start("").value(), folder_ / "ride-2.mcap") << "the name has been given";
}

TEST_F(RecorderTest, AFileThatCannotBeLookedAtIsRefusedAndItGoesOn) {
  fs::create_directories(folder_);
  fs::create_symlink("loop", folder_ / "loop");
  auto recorder = this->recorder();
  for (const auto& file : {folder_ / "loop", folder_ / "loop" / "x.mcap", folder_ / std::string(300, 'x')}) {
    EXPECT_FALSE(recorder->start(file).ok());
  }
  EXPECT_TRUE(recorder->start("").ok());
  EXPECT_EQ(recorder->state().failure, "");
}

TEST_F(RecorderTest, ABareNameIsOneInTheFolder) {
  auto recorder = this->recorder();
  EXPECT_EQ(recorder->start("ride1").value(), folder_ / "ride1.mcap");
  EXPECT_TRUE(recorder->housekeeper().protect("ride1", "by hand").ok());
  ASSERT_TRUE(recorder->stop().ok());
  EXPECT_EQ(recorder->start("ride2.mcap").value(), folder_ / "ride2.mcap");
}

}  // namespace

}  // namespace railfix::recorder
