// `railfix recording cut`, `merge` and `repair` as a user calls them, and what is left of them when they fail.
#include <nlohmann/json.hpp>
#include <random>

#include "integration/recording/recorded_ride.hpp"

namespace railfix {
namespace {

using ::testing::HasSubstr;

/// A long recording, and the same cut off.
class LongRecording : public RecordedRide {
 protected:
  void SetUp() override {
    RecordedRide::SetUp();
    writer_ = mcap::Writer::create(long_, {}).value();
    const auto channel = writer_->add_channel(0, "imu_sample", "cdr", {}).value();
    mcap::Bytes noise(60);
    for (int64_t i = 0; i < 300'000; ++i) {
      for (auto& byte : noise) byte = static_cast<uint8_t>(random_());
      ASSERT_TRUE(writer_->write({channel, 1, kBegin + i * 10'000'000, kBegin + i * 10'000'000, noise}).ok());
    }
    ASSERT_TRUE(writer_->close().ok());
    fs::copy_file(long_, damaged_);
    fs::resize_file(damaged_, fs::file_size(damaged_) - 100);
    here_ = files();
  }
  [[nodiscard]] std::vector<std::vector<std::string>> commands() const {
    return {{"cut", long_, "--to", "10000", "--out", out_},
            {"merge", long_, file(), "--out", out_},
            {"repair", damaged_, "--out", out_}};
  }

  fs::path long_ = folder_ / "long.mcap";
  fs::path damaged_ = folder_ / "damaged.mcap";
  fs::path out_ = folder_ / "out.mcap";
  std::set<std::string> here_;
  std::minstd_rand random_;
};

TEST_F(LongRecording, NothingIsLeftOfACopyThatFindsNoRoom) {
  for (const auto& command : commands()) {
    std::string line;
    for (const auto& word : command) line += word + " ";
    const auto full = recording_in(100, line);
    EXPECT_EQ(full.exit_code, 2) << full.out;
    EXPECT_THAT(full.err, HasSubstr("out.mcap.active: cannot be written; is the disk full? (File too large)"));
    EXPECT_EQ(files(), here_) << line;
  }
}

TEST_F(LongRecording, NothingIsLeftOfACopyThatIsInterrupted) {
  for (auto command : commands()) {
    for (const int signal : {SIGINT, SIGTERM}) {
      auto arguments = command;
      arguments.insert(arguments.begin(), {"railfix", "recording"});
      test::Program copy(arguments);
      while (!fs::exists(folder_ / "out.mcap.active") && !copy.exit_code()) poll(nullptr, 0, 1);
      EXPECT_EQ(copy.end(signal), 128 + signal) << command.front();
      EXPECT_EQ(files(), here_) << command.front();
    }
  }
}

TEST_F(LongRecording, WhatIsMissingIsToldAndAddsUp) {
  std::fstream(long_, std::ios::binary | std::ios::in | std::ios::out)
      .seekp(static_cast<std::streamoff>(fs::file_size(long_) / 2))
      .write("XXXXXXXX", 8);
  const auto info = recording({"info", long_, "--json"});
  EXPECT_EQ(info.exit_code, 1);
  const auto json = nlohmann::json::parse(info.out);
  EXPECT_EQ(json["samples_by_index"], 300'000);
  EXPECT_LT(json["samples"], 300'000);
  EXPECT_EQ(json["samples"], json["topics"][0]["samples"]);
  EXPECT_THAT(recording({"info", long_}).out, HasSubstr(" samples can be counted; by its index there were 300000 in "));

  const auto repaired = recording({"repair", long_, "--out", out_});
  ASSERT_EQ(repaired.exit_code, 0) << repaired.err;
  const auto lost = 300'000 - json["samples"].get<int>();
  EXPECT_THAT(repaired.out, HasSubstr("; missing: " + std::to_string(lost) + " samples, 1 chunk, "));
  EXPECT_THAT(recording({"info", out_}).out, HasSubstr("railfix_repair: file=long.mcap lost_chunks=1 lost_samples=" +
                                                       std::to_string(lost) + " skipped_bytes="));
}

TEST_F(LongRecording, WhatInfoCallsDamagedIsRepaired) {
  std::fstream(long_, std::ios::binary | std::ios::in | std::ios::out).seekp(8).write("\xFF", 1);  // of the header
  EXPECT_EQ(recording({"info", long_}).exit_code, 1);
  const auto repaired = recording({"repair", long_, "--out", out_});
  EXPECT_EQ(repaired.exit_code, 0) << repaired.err;
  EXPECT_THAT(repaired.out, HasSubstr("300000 samples of 1 topics")) << repaired.err;
  EXPECT_EQ(recording({"info", out_}).exit_code, 0);
}

TEST_F(LongRecording, RepairDoesNotWriteOverWhatItReads) {
  const fs::path active = folder_ / "run.mcap.active";
  fs::copy_file(damaged_, active);
  const auto refused = recording({"repair", active, "--out", folder_ / "run.mcap"});
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_THAT(refused.err, HasSubstr("would be " + active.string() + ", which is read; give another name with --out"));
  EXPECT_EQ(fs::file_size(active), fs::file_size(damaged_));
}

}  // namespace
}  // namespace railfix
