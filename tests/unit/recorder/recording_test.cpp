#include "recorder/recording.hpp"

#include <gmock/gmock.h>
#include <unistd.h>

#include <fstream>

#include "mcap/reader.hpp"

namespace railfix::recorder {

namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using ::testing::Not;

class RecordingFolder : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::temp_directory_path() / ("railfix-recorder-" + std::to_string(::getpid()));
    fs::remove_all(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }

  [[nodiscard]] std::unique_ptr<Recording> create(const std::string& name) const {
    return Recording::create(folder_ / name, {}, {{"train_id", "demo"}}).value();
  }
  static core::Status write(Recording& recording, const std::string& topic, uint32_t sequence) {
    static const std::vector<uint8_t> data{0, 1, 0, 0, 9};
    const auto channel = std::make_shared<const ChannelOf>(
        ChannelOf{topic, "railfix::msg::Any", "struct Any { octet x; };", {{"keyed", "false"}}});
    return recording.write(StoredSample{channel, sequence, 1000 + sequence, 900 + sequence, data, ""});
  }
  fs::path folder_;
};

TEST_F(RecordingFolder, HoldsSamplesChannelsAndWhatTheTrainWas) {
  auto recording = create("a/b/one.mcap");
  ASSERT_TRUE(write(*recording, "track_view", 1).ok());
  ASSERT_TRUE(write(*recording, "imu_sample", 1).ok());
  ASSERT_TRUE(write(*recording, "track_view", 2).ok());
  ASSERT_TRUE(recording->close().ok());
  auto reader = mcap::Reader::open(folder_ / "a/b/one.mcap").value();
  EXPECT_EQ(reader->statistics().messages, 3U);
  EXPECT_EQ(reader->statistics().channels, 2U);
  EXPECT_EQ(reader->schemas().at(1).encoding, "omgidl");
  EXPECT_EQ(reader->channels().at(1).message_encoding, "cdr");
  ASSERT_EQ(reader->metadata().size(), 1U);
  EXPECT_EQ(reader->metadata()[0].name, "railfix");
  EXPECT_EQ(reader->metadata()[0].entries.at("train_id"), "demo");
}

TEST_F(RecordingFolder, WhatAStandbyWritesUnheardIsNotLost) {
  auto recording = create("standby.mcap");
  for (const uint64_t sequence : {5, 6}) recording->note_sequence("train_state", 1, sequence, true);
  for (const uint64_t sequence : {5, 6}) recording->note_sequence("train_state", 2, sequence, true);
  recording->note_sequence("train_state", 1, 50, true);
  recording->note_sequence("train_state", 2, 99, true);
  EXPECT_EQ(recording->loss_text(), "");
  recording->note_sequence("train_state", 2, 102, true);
  EXPECT_EQ(recording->loss_text(), "train_state: 2 transport");
}

TEST_F(RecordingFolder, GapsAreTransportUnlessADropExplainsThem) {
  auto recording = create("gaps.mcap");
  for (const uint64_t sequence : {5, 6, 9, 10}) recording->note_sequence("track_view", 1, sequence);
  recording->note_sequence("track_view", 2, 100);  // another writer counts on its own
  EXPECT_EQ(recording->loss_text(), "track_view: 2 transport");
  recording->add_dropped("track_view", Loss::queue, 2);
  EXPECT_EQ(recording->loss_text(), "track_view: 2 queue");
  recording->add_dropped("camera_frame/cam0", Loss::encoder, 7);
  for (const uint64_t sequence : {1, 10}) recording->note_sequence("camera_frame/cam0", 3, sequence);
  EXPECT_EQ(recording->loss_text(), "camera_frame/cam0: 1 transport, 7 encoder; track_view: 2 queue");
  EXPECT_EQ(recording->lost_samples(), 10U);
  ASSERT_TRUE(recording->close().ok());
  auto reader = mcap::Reader::open(folder_ / "gaps.mcap").value();
  ASSERT_EQ(reader->metadata().size(), 2U);
  EXPECT_EQ(reader->metadata()[1].name, "railfix_losses");
  EXPECT_EQ(reader->metadata()[1].entries.at("camera_frame/cam0 encoder"), "7");
}

TEST_F(RecordingFolder, FingerprintsTellFilesApart) {
  fs::create_directories(folder_);
  std::ofstream(folder_ / "map.bin") << "123456789";
  EXPECT_EQ(fingerprint(folder_ / "map.bin"), "map.bin crc32 cbf43926");  // the check value of CRC-32/ISO-HDLC
  EXPECT_EQ(fingerprint(""), "");
  EXPECT_THAT(fingerprint(folder_ / "none"), HasSubstr("not readable"));
}

TEST_F(RecordingFolder, EventsAreMarked) {
  auto recording = create("marked.mcap");
  ASSERT_TRUE(recording->write_event({77, "a jolt", "by hand"}).ok());
  ASSERT_TRUE(recording->close().ok());
  auto reader = mcap::Reader::open(folder_ / "marked.mcap").value();
  ASSERT_EQ(reader->metadata().size(), 2U);
  EXPECT_EQ(reader->metadata()[1].name, "railfix_event");
  EXPECT_EQ(reader->metadata()[1].entries.at("time_ns"), "77");
  EXPECT_EQ(reader->metadata()[1].entries.at("text"), "a jolt");
}

TEST_F(RecordingFolder, APauseIsNoLoss) {
  auto recording = create("pause.mcap");
  recording->note_sequence("track_view", 1, 5);
  recording->forget_sequences();
  recording->note_sequence("track_view", 1, 500);
  EXPECT_EQ(recording->loss_text(), "");
  recording->note_sequence("track_view", 1, 502);
  EXPECT_EQ(recording->loss_text(), "track_view: 1 transport");
}

TEST(Configuration, IsRecordedWithoutItsSecrets) {
  EXPECT_EQ(without_secrets("monitor:\n  token: abc def\n  port: 8080\ntpr_publisher:\n  mqtt_password: \"x: y\"\n"),
            "monitor:\n  token: not recorded\n  port: 8080\ntpr_publisher:\n  mqtt_password: not recorded\n");
  EXPECT_EQ(without_secrets("monitor: {token: abc, port: 1}"), "monitor: {token: not recorded, port: 1}\n");
}

TEST(Configuration, IsRecordedWithoutItsSecretsHoweverTheyAreWritten) {
  for (const char* yaml :
       {"monitor:\n  token:\n    s3cret\n", "monitor:\n  token: >-\n    s3cret\n    s3cret\n",
        "monitor: {token: \"a}s3cret\", port: 1}", "monitor:\n  ? token\n  : s3cret\n", "list: [{password: s3cret}]",
        "token: [s3cret, s3cret]", "monitor: &m\n  \"token\": 's3cret'\nother: *m\n", "# token: s3cret\na: 1",
        "a: &a s3cret\ntoken: *a", "token: s3cret\n  broken: [", "s3cret", "a: &a {token: s3cret, b: *a}"}) {
    EXPECT_THAT(without_secrets(yaml), Not(HasSubstr("s3cret"))) << yaml;
  }
  EXPECT_THAT(without_secrets("token: s3cret\n broken: ["), HasSubstr("not recorded: it cannot be read as YAML"));
}

TEST(Configuration, WhatIsNoSecretStaysAsItMeans) {
  const std::string kept =
      "common:\n  train_id: \"x: y\"\n  interfaces: []\nrecorder:\n  events:\n    - a.b == \"c: d\"\n  ring_s: 5";
  EXPECT_EQ(without_secrets(kept), kept + "\n");
}

}  // namespace

}  // namespace railfix::recorder
