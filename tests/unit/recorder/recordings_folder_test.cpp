#include "recorder/recordings_folder.hpp"

#include <gmock/gmock.h>
#include <sys/mount.h>
#include <unistd.h>

#include <cmath>
#include <fstream>

#include "core/random.hpp"
#include "core/time.hpp"
#include "mcap/reader.hpp"
#include "recorder/housekeeper.hpp"
#include "recorder/recorder_status.hpp"
#include "recorder/recording.hpp"

namespace railfix::recorder {

namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

class RecordingsFolder : public ::testing::Test {
 protected:
  RecordingsFolder() : folder_(fs::temp_directory_path() / ("railfix-folder-" + std::to_string(::getpid()))) {
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  ~RecordingsFolder() override { fs::remove_all(folder_); }

  void make(const std::string& name, int age_h) const {
    std::ofstream(folder_ / name) << std::string(1000, 'x');
    fs::last_write_time(folder_ / name, fs::file_time_type::clock::now() - std::chrono::hours(age_h));
  }
  /// A recording with one sample that a crash left open.
  void make_crashed(const std::string& name) const {
    auto recording = Recording::create(folder_ / "whole.mcap", {}, {{"train_id", "demo"}}).value();
    const auto channel = std::make_shared<const ChannelOf>(ChannelOf{"topic", "m::T", "struct T { octet x; };", {}});
    ASSERT_TRUE(recording->write(StoredSample{channel, 1, 1000, 900, {0, 1, 0, 0, 9}, ""}).ok());
    ASSERT_TRUE(recording->close().ok());
    const fs::path crashed = folder_ / (name + ".active");
    fs::rename(folder_ / "whole.mcap", crashed);
    fs::resize_file(crashed, fs::file_size(crashed) - 20);
  }
  /// What the housekeeper says when it has dealt with all that a crash left.
  [[nodiscard]] std::vector<std::string> recover(FolderRules rules) const {
    rules.recovers = true;
    Housekeeper housekeeper(folder_, rules);
    housekeeper.recover();
    return warnings(housekeeper);
  }
  /// Waits for some.
  static std::vector<std::string> warnings(Housekeeper& housekeeper) {
    const int64_t deadline_ns = core::monotonic_ns() + 30 * core::kNsPerSecond;
    std::vector<std::string> said;
    while (said.empty() && core::monotonic_ns() < deadline_ns) {
      ::usleep(10'000);
      said = housekeeper.take_warnings();
    }
    return said;
  }
  fs::path folder_;
};

TEST_F(RecordingsFolder, NamesAreUniqueAndInUtc) {
  const int64_t now_ns = 1'700'000'000 * core::kNsPerSecond;
  const fs::path first = new_name(folder_, "4711/a", now_ns);
  EXPECT_EQ(first.filename(), "4711_a-20231114-221320.mcap");
  std::ofstream(first).put('x');
  EXPECT_EQ(new_name(folder_, "4711/a", now_ns).filename(), "4711_a-20231114-221320-2.mcap");
  EXPECT_EQ(new_name(folder_, "t", now_ns, kEventKind).filename(), "t-20231114-221320-event.mcap");
}

TEST_F(RecordingsFolder, CrashedRecordingsAreRecoveredAndRunningOnesLeftAlone) {
  auto running = Recording::create(folder_ / "running.mcap", {}, {}).value();
  make_crashed("crashed.mcap");
  EXPECT_THAT(recover({}), ElementsAre(HasSubstr("was left by a crash; what it held is now in")));
  EXPECT_EQ(mcap::Reader::open(folder_ / "crashed-recovered.mcap").value()->statistics().messages, 1U);
  EXPECT_FALSE(fs::exists(folder_ / "crashed.mcap.active"));
  EXPECT_TRUE(fs::exists(folder_ / "running.mcap.active"));
  EXPECT_THAT(cut_off_in(folder_ / "nowhere"), IsEmpty());
}

TEST_F(RecordingsFolder, WhatIsBegunLaterIsNeverTakenForCutOff) {
  make_crashed("left.mcap");
  fs::last_write_time(folder_ / "left.mcap.active", fs::file_time_type::clock::now() - std::chrono::hours(1));
  Housekeeper housekeeper(folder_, {0, 0, true});
  make_crashed("begun.mcap");
  housekeeper.recover();
  // The newest is recovered first: when the other one is, this one's turn would be over.
  EXPECT_THAT(warnings(housekeeper), ElementsAre(HasSubstr("left.mcap.active was left by a crash")));
  EXPECT_TRUE(fs::exists(folder_ / "begun.mcap.active"));
}

TEST_F(RecordingsFolder, ProtectionOutlivesACrash) {
  make_crashed("event.mcap");
  ASSERT_TRUE(protect(folder_ / "event.mcap", "why").ok());
  (void)recover({});
  EXPECT_TRUE(is_protected(folder_ / "event-recovered.mcap"));
  EXPECT_FALSE(is_protected(folder_ / "event.mcap")) << "its file is gone";
  EXPECT_THAT(keep_quota(folder_, 1), IsEmpty());
}

TEST_F(RecordingsFolder, WithoutRoomACutOffRecordingStaysAndIsSaid) {
  make("old.mcap", 5);
  make_crashed("crashed.mcap");
  const uint64_t more_than_there_is = free_bytes(folder_);
  EXPECT_THAT(recover({0, more_than_there_is, true}), ElementsAre(HasSubstr("crashed.mcap.active was left by a crash "
                                                                            "and stays as it is until ")));
  EXPECT_TRUE(fs::exists(folder_ / "crashed.mcap.active"));
  EXPECT_FALSE(fs::exists(folder_ / "crashed-recovered.mcap.active"));
  EXPECT_TRUE(fs::exists(folder_ / "old.mcap")) << "without a quota nothing is removed";
}

// On a disk of its own.
TEST_F(RecordingsFolder, ACutOffRecordingIsTriedAgainWhenThereIsRoom) {
  if (mount("tmpfs", folder_.c_str(), "tmpfs", 0, "size=1m") != 0) GTEST_SKIP() << "a disk can be made by root only";
  make_crashed("crashed.mcap");
  const fs::path filler = folder_ / "notes.txt";
  std::ofstream(filler) << std::string(700'000, 'x');
  {
    Housekeeper housekeeper(folder_, {0, 300'000, true});
    housekeeper.recover();
    EXPECT_THAT(warnings(housekeeper), ElementsAre(HasSubstr("stays as it is until 1 MB of the disk are free")));
    fs::remove(filler);
    EXPECT_THAT(warnings(housekeeper), ElementsAre(HasSubstr("was left by a crash; what it held is now in")));
  }
  EXPECT_TRUE(fs::exists(folder_ / "crashed-recovered.mcap"));
  EXPECT_FALSE(fs::exists(folder_ / "crashed.mcap.active"));
  umount2(folder_.c_str(), MNT_DETACH);
}

// On a disk of its own.
TEST_F(RecordingsFolder, WithAQuotaOlderRecordingsMakeRoomForACutOffOne) {
  if (mount("tmpfs", folder_.c_str(), "tmpfs", 0, "size=1m") != 0) GTEST_SKIP() << "a disk can be made by root only";
  make("older.mcap", 5);
  make("kept.mcap", 9);
  make_crashed("crashed.mcap");
  ASSERT_TRUE(protect(folder_ / "kept.mcap", "why").ok());
  make("newer.mcap", -1);
  const fs::path crashed = folder_ / "crashed.mcap.active";
  EXPECT_THAT(make_room(folder_, free_bytes(folder_), crashed), IsEmpty()) << "there is room";
  EXPECT_THAT(make_room(folder_, free_bytes(folder_) + 2000, crashed), IsEmpty()) << "would not be enough";
  EXPECT_THAT(make_room(folder_, free_bytes(folder_) + 1000, crashed),
              ElementsAre(HasSubstr("older.mcap was removed to make room")));
  for (const char* kept : {"kept.mcap", "newer.mcap", "crashed.mcap.active"}) EXPECT_TRUE(fs::exists(folder_ / kept));
  umount2(folder_.c_str(), MNT_DETACH);
}

TEST_F(RecordingsFolder, WhatACutOffRecoveryLeftIsRemoved) {
  make_crashed("crashed.mcap");
  make("crashed-recovered.mcap.active", 1);
  EXPECT_THAT(keep_quota(folder_, 1000), IsEmpty()) << "takes its source's place, does not count";
  EXPECT_THAT(cut_off_in(folder_), ElementsAre(folder_ / "crashed.mcap.active"));
  EXPECT_FALSE(fs::exists(folder_ / "crashed-recovered.mcap.active"));
  fs::rename(folder_ / "crashed.mcap.active", folder_ / "x-recovered.mcap.active");
  EXPECT_THAT(cut_off_in(folder_), ElementsAre(folder_ / "x-recovered.mcap.active")) << "has no source: is one";
}

TEST_F(RecordingsFolder, TheQuotaRemovesWhatCouldNotBeRecoveredWhenItIsTheOldest) {
  make("a.mcap.active", 9);
  make("b.mcap", 5);
  EXPECT_THAT(keep_quota(folder_, 1500, {folder_ / "a.mcap.active"}),
              ElementsAre(HasSubstr("a.mcap.active, which a crash left and which was not recovered, was removed")));
  EXPECT_TRUE(fs::exists(folder_ / "b.mcap"));
}

TEST_F(RecordingsFolder, ARecoveryStopsWhenTheServiceEnds) {
  auto recording = Recording::create(folder_ / "large.mcap", {}, {}).value();
  const auto channel = std::make_shared<const ChannelOf>(ChannelOf{"topic", "m::T", "struct T { octet x; };", {}});
  core::Random random(1);
  std::vector<uint8_t> noise(1'000'000);
  for (auto& byte : noise) byte = static_cast<uint8_t>(random.next());
  for (uint32_t i = 0; i < 500; ++i) {
    ASSERT_TRUE(recording->write(StoredSample{channel, i, 1000 + i, 900, noise, ""}).ok());
  }
  ASSERT_TRUE(recording->close().ok());
  fs::rename(folder_ / "large.mcap", folder_ / "large.mcap.active");
  fs::resize_file(folder_ / "large.mcap.active", fs::file_size(folder_ / "large.mcap.active") - 20);
  {
    Housekeeper housekeeper(folder_, {0, 0, true});
    EXPECT_EQ(housekeeper.recovering(), "") << "not before it is told to";
    housekeeper.recover();
    const int64_t deadline_ns = core::monotonic_ns() + 30 * core::kNsPerSecond;
    while (housekeeper.recovering().empty()) {
      ASSERT_LT(core::monotonic_ns(), deadline_ns);
      ::usleep(1000);
    }
    EXPECT_EQ(housekeeper.recovering(), folder_ / "large.mcap.active");
  }
  EXPECT_TRUE(fs::exists(folder_ / "large.mcap.active"));
  EXPECT_FALSE(fs::exists(folder_ / "large-recovered.mcap"));
  EXPECT_FALSE(fs::exists(folder_ / "large-recovered.mcap.active"));
}

TEST_F(RecordingsFolder, QuotaRemovesTheOldestButNothingProtectedOrOpen) {
  make("new.mcap", 1);
  make("oldest.mcap", 9);
  make("older.mcap", 5);
  make("open.mcap.active", 20);
  make("notes.txt", 99);
  ASSERT_TRUE(protect(folder_ / "oldest.mcap", "a reason").ok());
  EXPECT_THAT(keep_quota(folder_, 4000), IsEmpty());
  EXPECT_THAT(keep_quota(folder_, 3500), ElementsAre(HasSubstr("older.mcap")));
  EXPECT_THAT(keep_quota(folder_, 1), ElementsAre(HasSubstr("new.mcap")));
  for (const char* kept : {"oldest.mcap", "oldest.mcap.protected", "open.mcap.active", "notes.txt"}) {
    EXPECT_TRUE(fs::exists(folder_ / kept)) << kept;
  }
  ASSERT_TRUE(unprotect(folder_ / "oldest.mcap").ok());
  EXPECT_THAT(keep_quota(folder_, 1), ElementsAre(HasSubstr("oldest.mcap")));
  EXPECT_FALSE(unprotect(folder_ / "oldest.mcap").ok()) << "is not protected any more";
}

TEST_F(RecordingsFolder, TheOldestDoesNotDependOnTheClock) {
  EXPECT_EQ(next_number(folder_), 1U);
  const auto make_numbered = [&](const std::string& name, int age_h) {
    auto recording =
        Recording::create(folder_ / name, {}, {{kNumberKey, std::to_string(next_number(folder_))}}).value();
    ASSERT_TRUE(recording->close().ok());
    fs::last_write_time(folder_ / name, fs::file_time_type::clock::now() - std::chrono::hours(age_h));
  };
  make("of-before.mcap", 1);
  make("of-long-before.mcap", 2);
  make_numbered("first.mcap", 5);
  make_numbered("clock-behind.mcap", 500'000);
  auto open = Recording::create(folder_ / "open.mcap", {}, {{kNumberKey, "7"}}).value();
  EXPECT_EQ(next_number(folder_), 8U) << "open ones count";
  EXPECT_THAT(keep_quota(folder_, 0), ElementsAre(HasSubstr("of-long-before.mcap"), HasSubstr("of-before.mcap"),
                                                  HasSubstr("first.mcap"), HasSubstr("clock-behind.mcap")));
}

TEST_F(RecordingsFolder, SurveyCountsWhatIsThere) {
  make("a.mcap", 1);
  make("b-event.mcap", 1);
  make("c.mcap.active", 1);
  make("notes.txt", 1);
  ASSERT_TRUE(protect(folder_ / "b-event.mcap", "event").ok());
  const Survey seen = survey(folder_);
  EXPECT_EQ(seen.files, 3U);
  EXPECT_EQ(seen.bytes, 3000U);
  EXPECT_EQ(seen.protected_files, 1U);
  EXPECT_EQ(seen.protected_bytes, 1000U);
  EXPECT_EQ(seen.event_bytes, 1000U);
  EXPECT_GT(seen.disk_free_bytes.value_or(0), 0U);
  EXPECT_EQ(survey(folder_ / "nowhere").files, 0U);
  EXPECT_FALSE(survey(folder_ / "nowhere").disk_free_bytes) << "cannot be told is not full";
  EXPECT_TRUE(std::isnan(status_of({}, survey(folder_ / "nowhere"), 0).disk_free_mb()));
}

TEST_F(RecordingsFolder, OnlyFilesOfEventsCountAsSuch) {
  make("re-event-1-20231114-221320.mcap", 5);
  EXPECT_EQ(survey(folder_).event_bytes, 0U) << "a train's name";
  make("re-event-1-20231114-221320-event.mcap", 5);
  const uint64_t one = survey(folder_).event_bytes;
  EXPECT_GT(one, 0U);
  make("t-20231114-221320-2-event-recovered.mcap", 5);
  EXPECT_GT(survey(folder_).event_bytes, one);
}

TEST_F(RecordingsFolder, RecordingsAreFoundByWhatPeopleCallThem) {
  make("a.mcap", 1);
  make("b.mcap.active", 1);
  for (const auto& name : {std::string("a"), std::string("a.mcap"), (folder_ / "a.mcap").string()}) {
    const auto found = find_recording(folder_, name);
    ASSERT_TRUE(found.ok()) << found.error().message;
    EXPECT_EQ(found.value(), folder_ / "a.mcap");
  }
  EXPECT_EQ(find_recording(folder_, "b.mcap.active").value(), folder_ / "b.mcap");
  for (const char* wrong : {"", "c", "../a.mcap", "/etc/passwd"}) EXPECT_FALSE(find_recording(folder_, wrong).ok());
}

TEST_F(RecordingsFolder, WhatCannotBeLookedAtThrowsNothing) {
  make("a.mcap", 1);
  const auto found = find_recording(folder_, std::string(252, 'x'));
  ASSERT_FALSE(found.ok());
  EXPECT_THAT(found.error().message, HasSubstr("there is no recording"));
  const fs::path loop = folder_ / "loop";
  fs::create_symlink("loop", loop);
  EXPECT_EQ(new_name(loop, "t", 0).filename(), "t-19700101-000000.mcap");
  EXPECT_FALSE(find_recording(loop, "a").ok());
  EXPECT_FALSE(find_recording(folder_, (loop / "a").string()).ok());
  EXPECT_EQ(survey(loop).files, 0U);
  EXPECT_THAT(keep_quota(loop, 1), IsEmpty());
}

TEST_F(RecordingsFolder, TheHousekeeperKeepsTheQuotaByItself) {
  make("old.mcap", 5);
  make("kept.mcap", 9);
  ASSERT_TRUE(protect(folder_ / "kept.mcap", "why").ok());
  Housekeeper housekeeper(folder_, {1500, 0, false});
  const int64_t deadline_ns = core::monotonic_ns() + 30 * core::kNsPerSecond;
  while (fs::exists(folder_ / "old.mcap") || housekeeper.survey().files != 1) {
    ASSERT_LT(core::monotonic_ns(), deadline_ns);
    ::usleep(10'000);
  }
  EXPECT_THAT(housekeeper.take_sentences(), ElementsAre(HasSubstr("old.mcap was removed")));
  EXPECT_TRUE(housekeeper.unprotect("kept").ok());
  EXPECT_FALSE(housekeeper.protect("gone", "why").ok());
  EXPECT_TRUE(housekeeper.protect("kept", "why").ok());
  EXPECT_TRUE(is_protected(folder_ / "kept.mcap"));
}

TEST_F(RecordingsFolder, WhatNoSampleCanBeReadOfStaysAsItIs) {
  const fs::path crashed = folder_ / "crashed.mcap.active";
  const std::string begin("\x89MCAP0\r\n", 8);
  std::ofstream(crashed, std::ios::binary) << begin << std::string(3000, '\0');
  EXPECT_THAT(recover({}), ElementsAre(HasSubstr("crashed.mcap.active was left by a crash, cannot be recovered now and "
                                                 "stays as it is: no sample of it can be read")));
  EXPECT_EQ(fs::file_size(crashed), 3008U);
  EXPECT_FALSE(fs::exists(folder_ / "crashed-recovered.mcap"));
  fs::resize_file(crashed, 8);
  EXPECT_THAT(recover({}), ElementsAre(HasSubstr("what it held is now in"))) << "there was nothing";
}

}  // namespace

}  // namespace railfix::recorder
