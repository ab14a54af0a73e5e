// Real topics inside one process, recorded into a file.
#include <gmock/gmock.h>

#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <set>

#include "cdr/decode.hpp"
#include "mcap/reader.hpp"
#include "recorder_fixture.hpp"

namespace railfix::recorder {

namespace {

using ::testing::HasSubstr;

TEST_F(RecorderTest, RecordsSamplesAndPicturesOfEveryTopic) {
  messaging::Writer<msg::OdometryStep> odometry(participant_, topics::odometry_step);
  messaging::Writer<msg::CameraFrame> camera(participant_, topics::camera_frame, "cam0");
  auto recorder = this->recorder();
  const auto started = recorder->start("");
  ASSERT_TRUE(started.ok()) << started.error().message;
  EXPECT_FALSE(recorder->start("").ok()) << "one recording at a time";
  ASSERT_TRUE(wait_until([&] { return odometry.matched_readers() == 1 && camera.matched_readers() == 1; }));

  constexpr uint64_t kPictures = 6;
  constexpr int kSteps = 200;
  for (int i = 0; i < kSteps; ++i) {
    msg::OdometryStep step;
    step.stamp_ns(i);
    step.distance_m(0.25 * i);
    ASSERT_TRUE(odometry.write(step));
    // No more history than the topic keeps: the test must not depend on how fast this machine is.
    ASSERT_TRUE(wait_until([&] { return i % 20 != 19 || recorder->state().written >= static_cast<uint64_t>(i / 2); }));
  }
  for (uint64_t seq = 1; seq <= kPictures; ++seq) {
    ASSERT_TRUE(camera.write_in_place([&](msg::CameraFrame& frame) { fill(frame, seq); }));
    ASSERT_TRUE(wait_until([&] { return last_picture_ns_ == 1000 + static_cast<int64_t>(seq); }));
  }
  const auto stopped = recorder->stop();
  ASSERT_TRUE(stopped.ok()) << stopped.error().message;
  EXPECT_FALSE(recorder->stop().ok());

  auto reader = mcap::Reader::open(started.value()).value();
  EXPECT_TRUE(reader->indexed());
  uint64_t pictures = 0;
  int steps = 0;
  reader->for_each({}, [&](const mcap::Channel& channel, const mcap::Message& message) {
    EXPECT_GT(message.publish_time_ns, 0);
    EXPECT_GE(message.log_time_ns, message.publish_time_ns);
    const mcap::Schema& schema = reader->schemas().at(channel.schema_id);
    // What the file itself says is enough to decode it.
    cdr::Types types;
    EXPECT_TRUE(types.add(schema.data).ok());
    const auto json = cdr::decode(types, schema.name, message.data);
    EXPECT_TRUE(json.ok()) << json.error().message;
    if (channel.topic == "odometry_step") {
      EXPECT_EQ(json.value()["distance_m"], 0.25 * steps);
      EXPECT_EQ(message.sequence, static_cast<uint32_t>(++steps));
    } else if (channel.topic == "camera_frame/cam0") {
      EXPECT_EQ(schema.name, "railfix::msg::CameraPreview");
      msg::CameraPreview picture;
      EXPECT_TRUE(messaging::deserialize({message.data.begin(), message.data.end()}, picture));
      EXPECT_EQ(picture.seq(), ++pictures);
      EXPECT_EQ(picture.stamp_ns(), 1000 + static_cast<int64_t>(pictures));
      EXPECT_EQ(picture.health(), msg::PICTURE_DARK);
      const cv::Mat pixels = cv::imdecode(picture.jpeg(), cv::IMREAD_GRAYSCALE);
      EXPECT_NEAR(pixels.at<uint8_t>(100, 100), 50 + static_cast<int>(pictures), 4);
    }
    return true;
  });
  EXPECT_EQ(steps, kSteps);
  EXPECT_EQ(pictures, kPictures);
  EXPECT_EQ(reader->metadata().size(), 1U) << "nothing was lost: " << stopped.value();
}

TEST_F(RecorderTest, CamerasThatAppearLaterAreFound) {
  config_.cameras = {};
  config_.picture_every = 2;
  auto recorder = this->recorder();
  const auto started = recorder->start((folder_ / "later.mcap").string());
  ASSERT_TRUE(started.ok());
  messaging::Participant elsewhere(options());
  messaging::Writer<msg::CameraFrame> camera(elsewhere, topics::camera_frame, "rear");
  ASSERT_TRUE(wait_until([&] { return camera.matched_readers() == 1; }));
  auto frame = std::make_unique<msg::CameraFrame>();
  for (uint64_t seq = 1; seq <= 4; ++seq) {
    fill(*frame, seq);
    ASSERT_TRUE(camera.write(*frame));
    ASSERT_TRUE(wait_until([&] { return last_picture_ns_ == 1000 + static_cast<int64_t>(seq); }));
  }
  ASSERT_TRUE(recorder->stop().ok());
  auto reader = mcap::Reader::open(folder_ / "later.mcap").value();
  EXPECT_EQ(reader->statistics().messages, 2U) << "every second picture";
  EXPECT_EQ(reader->channels().begin()->second.topic, "camera_frame/rear");
}

TEST_F(RecorderTest, ANewFileRepeatsStandingValues) {
  config_.split_mb = 0.03;
  config_.compression = "none";
  config_.chunk_age_s = 0.05;
  messaging::Writer<msg::CameraCalibration> calibration(participant_, topics::camera_calibration);
  messaging::Writer<msg::LogRecord> log(participant_, topics::log_record);
  for (const char* camera : {"cam0", "cam1"}) {
    msg::CameraCalibration sample;
    sample.camera(camera);
    ASSERT_TRUE(calibration.write(sample));
  }
  auto recorder = this->recorder();
  const auto started = recorder->start("");
  ASSERT_TRUE(started.ok());
  ASSERT_TRUE(wait_until([&] { return recorder->state().written >= 2; }));
  msg::LogRecord record;
  record.text(std::string(1000, 'x'));
  std::string second;
  ASSERT_TRUE(wait_until([&] {
    second = recorder->state().file;
    return second != started.value() || !log.write(record);
  }));
  ASSERT_NE(second, started.value());
  ASSERT_TRUE(recorder->stop().ok());
  for (const auto& file : {started.value(), second}) {
    auto reader = mcap::Reader::open(file).value();
    EXPECT_TRUE(reader->indexed());
    std::set<std::string> cameras;
    reader->for_each({{"camera_calibration"}, {}, {}}, [&](const mcap::Channel&, const mcap::Message& message) {
      msg::CameraCalibration sample;
      EXPECT_TRUE(messaging::deserialize({message.data.begin(), message.data.end()}, sample));
      return cameras.insert(sample.camera().c_str()).second;
    });
    EXPECT_EQ(cameras, (std::set<std::string>{"cam0", "cam1"})) << file;
  }
}

TEST_F(RecorderTest, GoesOnInTheOldFileWhenANewOneCannotBeBegunAndTriesAgain) {
  config_.split_mb = 0.03;
  config_.compression = "none";
  config_.chunk_age_s = 0.05;
  messaging::Writer<msg::LogRecord> log(participant_, topics::log_record);
  auto recorder = this->recorder();
  const auto started = recorder->start("");
  ASSERT_TRUE(started.ok());
  const fs::path away = folder_.string() + "-away";
  fs::rename(folder_, away);
  std::ofstream(folder_) << "no folder can be here";
  uint64_t sent = 0;
  const auto send = [&] {
    msg::LogRecord record;
    record.text(std::string(1000, 'x'));
    sent += log.write(record) ? 1 : 0;
  };
  ASSERT_TRUE(wait_until([&] { return send(), !recorder->state().problem.empty(); }));
  EXPECT_THAT(recorder->state().problem, HasSubstr("no new file can be begun, " + started.value() + " goes on"));
  EXPECT_TRUE(recorder->state().recording);
  for (int i = 0; i < 20; ++i) send();
  ASSERT_TRUE(wait_until([&] { return recorder->state().written == sent; }));
  EXPECT_FALSE(recorder->state().problem.empty()) << "until a file can be begun";

  fs::remove(folder_);
  fs::rename(away, folder_);
  ASSERT_TRUE(wait_until([&] { return recorder->state().file != started.value(); }));
  EXPECT_TRUE(recorder->state().problem.empty());
  send();
  ASSERT_TRUE(wait_until([&] { return recorder->state().written == sent; }));
  const std::string second = recorder->state().file;
  ASSERT_TRUE(recorder->stop().ok());
  uint64_t messages = 0;
  for (const auto& file : {started.value(), second})
    messages += mcap::Reader::open(file).value()->statistics().messages;
  EXPECT_EQ(messages, sent);
}

TEST_F(RecorderTest, WhatWasSaidBeforeItListenedIsNotLost) {
  messaging::Writer<msg::ServiceStatus> status(participant_, topics::service_status);
  const auto say = [&](const std::string& service) {
    msg::ServiceStatus sample;
    sample.service(service);
    ASSERT_TRUE(status.write(sample));
  };
  say("fusion");
  for (int i = 0; i < 20; ++i) say("odometry");
  auto recorder = this->recorder();
  ASSERT_TRUE(recorder->start((folder_ / "late.mcap").string()).ok());
  ASSERT_TRUE(wait_until([&] { return recorder->state().written == 2; })) << "the last word of each";
  for (int i = 0; i < 3; ++i) say("odometry");
  ASSERT_TRUE(wait_until([&] { return recorder->state().written == 5; }));
  EXPECT_EQ(recorder->state().losses, "");
}

// A service says why it cannot start before anybody has found it.
TEST_F(RecorderTest, LinesOfTheLogFromBeforeItListenedAreRecordedAndNoEvent) {
  config_.events = {"log_record.level >= error"};
  messaging::Writer<msg::LogRecord> log(participant_, topics::log_record);
  const auto say = [&](const std::string& text) {
    msg::LogRecord record;
    record.level(4);
    record.text(text);
    ASSERT_TRUE(log.write(record));
  };
  say("cannot be opened");
  say("gives up");
  auto recorder = this->recorder();
  const auto started = recorder->start("");
  ASSERT_TRUE(started.ok());
  ASSERT_TRUE(wait_until([&] { return recorder->state().written == 2; })) << recorder->state().written;
  EXPECT_FALSE(recorder->state().event) << "it happened long ago";
  say("now");
  ASSERT_TRUE(wait_until([&] { return recorder->state().event.has_value(); }));
  ASSERT_TRUE(recorder->stop().ok());
  std::vector<std::string> texts;
  auto reader = mcap::Reader::open(started.value()).value();
  reader->for_each({{"log_record"}, {}, {}}, [&](const mcap::Channel& channel, const mcap::Message& message) {
    EXPECT_EQ(channel.metadata.at("transient_local"), "false") << "no line stands for what lasts";
    EXPECT_LE(message.publish_time_ns, message.log_time_ns);
    msg::LogRecord record;
    EXPECT_TRUE(messaging::deserialize({message.data.begin(), message.data.end()}, record));
    texts.emplace_back(record.text().c_str());
    return true;
  });
  EXPECT_THAT(texts, ::testing::ElementsAre("cannot be opened", "gives up", "now"));
}

TEST_F(RecorderTest, ATopicToLeaveOutThatThereIsNotIsRefused) {
  config_.leave_out = {"camera_frame/cam0", "log_record"};
  EXPECT_NO_THROW((void)recorder());
  config_.leave_out = {"log_recrod"};
  EXPECT_THROW((void)recorder(), core::BadInput);
}

TEST_F(RecorderTest, RecordingsAreNumberedAlsoAfterARestart) {
  for (int i = 0; i < 2; ++i) {
    auto recorder = this->recorder();
    for (int k = 0; k < 2; ++k) {
      const auto started = recorder->start("");
      ASSERT_TRUE(started.ok()) << started.error().message;
      ASSERT_TRUE(recorder->stop().ok());
      const auto about = mcap::metadata_in_front(started.value(), "railfix");
      EXPECT_EQ(about.value().entries.at("number"), std::to_string(2 * i + k + 1));
    }
  }
}

TEST_F(RecorderTest, WhatIsThrownInItsThreadClosesTheFileAndIsSaid) {
  messaging::Writer<msg::CameraFrame> camera(participant_, topics::camera_frame, "cam0");
  Recorder recorder(config_, participant_, {{"train_id", "demo"}, {"version", "test"}},
                    [](int64_t) { throw std::runtime_error("no such thing"); });
  const auto started = recorder.start("");
  ASSERT_TRUE(started.ok());
  ASSERT_TRUE(wait_until([&] { return camera.matched_readers() == 1; }));
  auto frame = std::make_unique<msg::CameraFrame>();
  fill(*frame, 1);
  ASSERT_TRUE(camera.write(*frame));
  ASSERT_TRUE(wait_until([&] { return !recorder.state().failure.empty(); }));
  EXPECT_THAT(recorder.state().failure, HasSubstr("cannot go on: no such thing"));
  ASSERT_TRUE(wait_until([&] { return !recorder.state().recording; }));
  EXPECT_EQ(mcap::Reader::open(started.value()).value()->statistics().messages, 1U);
}

TEST_F(RecorderTest, ATopicThatCannotBeReadIsAnError) {
  fs::create_directories(folder_);
  const fs::path profiles = folder_ / "profiles.xml";
  std::ofstream(profiles) << R"(<dds xmlns="http://www.eprosima.com"><profiles>
    <data_reader profile_name="imu_sample"><qos><durability><kind>PERSISTENT</kind></durability></qos>
    </data_reader></profiles></dds>)";
  auto with_profiles = options();
  with_profiles.qos_profiles = profiles.string();
  messaging::Participant participant(with_profiles);
  const std::map<std::string, std::string> about{{"train_id", "demo"}, {"version", "test"}};
  {
    Recorder recorder(config_, participant, about, [](int64_t) {});
    const auto started = recorder.start("");
    ASSERT_FALSE(started.ok());
    EXPECT_THAT(started.error().message, HasSubstr("imu_sample cannot be read"));
    EXPECT_FALSE(recorder.state().recording);
  }
  config_.ring_s = 1;
  EXPECT_THROW(Recorder(config_, participant, about, [](int64_t) {}), core::BadInput);
}

TEST_F(RecorderTest, DestructionClosesTheFile) {
  (void)recorder()->start((folder_ / "gone.mcap").string());
  EXPECT_TRUE(mcap::Reader::open(folder_ / "gone.mcap").value()->indexed());
}

}  // namespace

}  // namespace railfix::recorder
