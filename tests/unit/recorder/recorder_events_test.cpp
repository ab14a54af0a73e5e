// Commands, pauses, events and the quota, with real topics inside one process.
#include <gmock/gmock.h>
#include <opencv2/imgcodecs.hpp>

#include "mcap/reader.hpp"
#include "recorder_fixture.hpp"

namespace railfix::recorder {

namespace {

using ::testing::HasSubstr;

constexpr const char* kAtHundred = "odometry_step.stamp_ns >= 100";
constexpr const char* kAtEnd = "odometry_step.stamp_ns >= 149";

class RecorderEventsTest : public RecorderTest {
 protected:
  static void write_steps(messaging::Writer<msg::OdometryStep>& writer, int64_t from, int64_t to) {
    for (int64_t i = from; i < to; ++i) {
      msg::OdometryStep step;
      step.stamp_ns(i);
      ASSERT_TRUE(writer.write(step));
      ::usleep(2000);  // no more at once than the topic's history holds
    }
  }
  static std::vector<int64_t> steps_in(mcap::Reader& reader) {
    std::vector<int64_t> stamps;
    reader.for_each({{"odometry_step"}, {}, {}}, [&](const mcap::Channel&, const mcap::Message& message) {
      msg::OdometryStep step;
      EXPECT_TRUE(messaging::deserialize({message.data.begin(), message.data.end()}, step));
      stamps.push_back(step.stamp_ns());
      return true;
    });
    return stamps;
  }
  [[nodiscard]] std::vector<fs::path> event_files() const {
    std::vector<fs::path> files;
    std::error_code missing;
    for (const auto& entry : fs::directory_iterator(folder_, missing)) {
      if (entry.path().extension() == ".mcap" && entry.path().stem().string().ends_with(kEventKind)) {
        files.push_back(entry.path());
      }
    }
    return files;
  }
  static bool happened(const Recorder& recorder, const std::string& trigger) {
    const auto state = recorder.state();
    return state.event && state.event->trigger == trigger;
  }
};

enum class Phase { stopped, recording, paused };

Phase phase_of(const Recorder& recorder) {
  const auto state = recorder.state();
  return state.paused ? Phase::paused : state.recording ? Phase::recording : Phase::stopped;
}

struct Command {
  const char* name;
  std::function<core::Result<std::string>(Recorder&)> give;
  // Where it leads from stopped, recording and paused; nothing: refused.
  std::array<std::optional<Phase>, 3> leads_to;
};

TEST_F(RecorderEventsTest, EveryCommandInEveryState) {
  const std::optional<Phase> refused;
  const std::vector<Command> commands{
      {"start", [](Recorder& thread) { return thread.start(""); }, {Phase::recording, refused, refused}},
      {"stop", [](Recorder& thread) { return thread.stop(); }, {refused, Phase::stopped, Phase::stopped}},
      {"pause", [](Recorder& thread) { return thread.pause(); }, {refused, Phase::paused, refused}},
      {"resume", [](Recorder& thread) { return thread.resume(); }, {refused, refused, Phase::recording}},
      {"event", [](Recorder& thread) { return thread.event("x"); }, {refused, Phase::recording, Phase::paused}},
  };
  for (const bool ring : {false, true}) {
    config_.ring_s = ring ? 1 : 0;
    config_.after_s = 0;
    auto recorder = this->recorder();
    for (const Phase phase : {Phase::stopped, Phase::recording, Phase::paused}) {
      for (const auto& command : commands) {
        (void)recorder->stop();
        if (phase != Phase::stopped) (void)recorder->start("");
        if (phase == Phase::paused) (void)recorder->pause();
        ASSERT_EQ(phase_of(*recorder), phase);
        const auto done = command.give(*recorder);
        auto expected = command.leads_to[static_cast<size_t>(phase)];
        if (ring && phase == Phase::stopped && std::string(command.name) == "event") expected = phase;
        const std::string what = std::string(command.name) + " in state " + std::to_string(static_cast<int>(phase)) +
                                 (ring ? " with ring" : "");
        EXPECT_EQ(done.ok(), expected.has_value()) << what;
        EXPECT_EQ(phase_of(*recorder), expected.value_or(phase)) << what;
        EXPECT_EQ(recorder->state().ring, ring);
      }
    }
  }
}

TEST_F(RecorderEventsTest, APauseLeavesOutWhatComesAndCountsNoLoss) {
  config_.events = {kAtHundred};
  messaging::Writer<msg::OdometryStep> odometry(participant_, topics::odometry_step);
  messaging::Writer<msg::CameraCalibration> calibration(participant_, topics::camera_calibration);
  ASSERT_TRUE(calibration.write(msg::CameraCalibration()));
  auto recorder = this->recorder();
  const auto file = recorder->start("");
  ASSERT_TRUE(file.ok());
  ASSERT_TRUE(wait_until([&] { return odometry.matched_readers() == 1 && recorder->state().written >= 1; }));
  write_steps(odometry, 0, 50);
  ASSERT_TRUE(wait_until([&] { return recorder->state().written >= 51; }));
  ASSERT_TRUE(recorder->pause().ok());
  write_steps(odometry, 50, 101);
  ASSERT_TRUE(wait_until([&] { return happened(*recorder, kAtHundred); })) << "rules are looked at in a pause too";
  ASSERT_TRUE(recorder->resume().ok());
  write_steps(odometry, 101, 151);
  ASSERT_TRUE(wait_until([&] { return recorder->state().written >= 101; }));
  EXPECT_EQ(recorder->state().lost, 0U) << recorder->state().losses;
  ASSERT_TRUE(recorder->stop().ok());
  auto reader = mcap::Reader::open(file.value()).value();
  const auto stamps = steps_in(*reader);
  ASSERT_EQ(stamps.size(), 100U);
  EXPECT_EQ(stamps[49], 49);
  EXPECT_EQ(stamps[50], 101);
  EXPECT_EQ(reader->statistics().messages, 102U) << "the calibration stands in it twice";
}

TEST_F(RecorderEventsTest, ARuleMakesAProtectedFileWithFullPicturesAroundIt) {
  config_.events = {kAtHundred, kAtEnd};
  config_.ring_s = 600;
  config_.after_s = 600;
  config_.compression = "lz4";
  messaging::Writer<msg::OdometryStep> odometry(participant_, topics::odometry_step);
  messaging::Writer<msg::CameraFrame> camera(participant_, topics::camera_frame, "cam0");
  auto recorder = this->recorder();
  ASSERT_TRUE(wait_until([&] { return odometry.matched_readers() == 1 && camera.matched_readers() == 1; }))
      << "it listens without being told to record";
  const auto continuous = recorder->start("");
  ASSERT_TRUE(continuous.ok());
  for (uint64_t seq = 1; seq <= 3; ++seq) {
    ASSERT_TRUE(camera.write_in_place([&](msg::CameraFrame& frame) { fill(frame, seq); }));
    ASSERT_TRUE(wait_until([&] { return last_picture_ns_ == 1000 + static_cast<int64_t>(seq); }));
  }
  write_steps(odometry, 0, 120);
  ASSERT_TRUE(wait_until([&] { return happened(*recorder, kAtHundred); }));
  write_steps(odometry, 120, 150);
  ASSERT_TRUE(wait_until([&] { return happened(*recorder, kAtEnd); }));
  recorder.reset();

  const auto files = event_files();
  ASSERT_EQ(files.size(), 1U) << "the second event shares the file of the first";
  EXPECT_TRUE(is_protected(files[0]));
  EXPECT_FALSE(is_protected(continuous.value()));
  auto reader = mcap::Reader::open(files[0]).value();
  EXPECT_TRUE(reader->indexed());
  const auto stamps = steps_in(*reader);
  ASSERT_EQ(stamps.size(), 150U);
  EXPECT_EQ(stamps.front(), 0);
  EXPECT_EQ(std::ranges::count(reader->metadata(), "railfix_event", &mcap::Metadata::name), 2);
  uint64_t pictures = 0;
  reader->for_each({{"camera_frame/cam0"}, {}, {}}, [&](const mcap::Channel&, const mcap::Message& message) {
    msg::CameraPreview picture;
    EXPECT_TRUE(messaging::deserialize({message.data.begin(), message.data.end()}, picture));
    const cv::Mat pixels = cv::imdecode(picture.jpeg(), cv::IMREAD_GRAYSCALE);
    auto sent = std::make_unique<msg::CameraFrame>();
    fill(*sent, ++pictures);
    EXPECT_TRUE(std::equal(pixels.datastart, pixels.dataend, sent->data().begin())) << "every pixel";
    return true;
  });
  EXPECT_EQ(pictures, 3U);

  auto other = mcap::Reader::open(continuous.value()).value();
  EXPECT_EQ(std::ranges::count(other->metadata(), "railfix_event", &mcap::Metadata::name), 2);
  other->for_each({{"camera_frame/cam0"}, {}, {}}, [&](const mcap::Channel&, const mcap::Message& message) {
    msg::CameraPreview picture;
    EXPECT_TRUE(messaging::deserialize({message.data.begin(), message.data.end()}, picture));
    EXPECT_EQ(picture.jpeg().at(0), 0xFF) << "a JPEG";
    return true;
  });
}

TEST_F(RecorderEventsTest, WithoutARingAnEventProtectsTheRecording) {
  auto recorder = this->recorder();
  EXPECT_THAT(recorder->event("too early").error().message, HasSubstr("nothing is being recorded and no ring is kept"));
  const auto file = recorder->start("");
  ASSERT_TRUE(file.ok());
  const auto marked = recorder->event("a jolt");
  ASSERT_TRUE(marked.ok()) << marked.error().message;
  EXPECT_EQ(marked.value(), "marked in " + file.value() + ", which is protected now");
  EXPECT_TRUE(is_protected(file.value()));
  ASSERT_TRUE(recorder->stop().ok());
  EXPECT_EQ(mcap::Reader::open(file.value()).value()->metadata().back().entries.at("text"), "a jolt");
}

TEST_F(RecorderEventsTest, RulesGetNoFilesWithoutRoomButPeopleDo) {
  config_.ring_s = 1;
  config_.after_s = 0;
  config_.events_mb = 0;
  config_.events = {"odometry_step"};
  messaging::Writer<msg::OdometryStep> odometry(participant_, topics::odometry_step);
  auto recorder = this->recorder();
  ASSERT_TRUE(wait_until([&] { return odometry.matched_readers() == 1; }));
  write_steps(odometry, 0, 1);
  ASSERT_TRUE(wait_until([&] { return happened(*recorder, "odometry_step"); }));
  const auto news = recorder->take_state().news;
  ASSERT_EQ(news.size(), 1U);
  EXPECT_TRUE(news[0].bad);
  EXPECT_THAT(news[0].sentence, HasSubstr("more than events_mb"));
  EXPECT_TRUE(event_files().empty());
  const auto by_hand = recorder->event("look at this");
  ASSERT_TRUE(by_hand.ok()) << by_hand.error().message;
  recorder.reset();
  EXPECT_EQ(event_files().size(), 1U);
}

TEST_F(RecorderEventsTest, AFullDiskGetsNoEventFile) {
  config_.keep_free_mb = 1e12;
  config_.ring_s = 1;
  auto recorder = this->recorder();
  fs::create_directories(folder_);
  EXPECT_THAT(recorder->event("x").error().message, HasSubstr("less than keep_free_mb"));
}

TEST_F(RecorderEventsTest, ARuleThatCannotBeMeantIsRefused) {
  config_.events = {"train_state.speed > 3"};
  EXPECT_THROW((void)recorder(), core::BadInput);
}

TEST_F(RecorderEventsTest, TheQuotaIsKeptWhileRecording) {
  config_.split_mb = 0.05;
  config_.quota_mb = 0.2;
  config_.compression = "none";
  config_.chunk_age_s = 0.05;
  messaging::Writer<msg::LogRecord> log(participant_, topics::log_record);
  auto recorder = this->recorder();
  const auto first = recorder->start("");
  ASSERT_TRUE(first.ok());
  ASSERT_TRUE(wait_until([&] { return log.matched_readers() == 1; }));
  msg::LogRecord record;
  record.text(std::string(1000, 'x'));
  std::string removed;
  ASSERT_TRUE(wait_until([&] {
    EXPECT_TRUE(log.write(record));
    for (const auto& sentence : recorder->housekeeper().take_sentences()) removed = sentence;
    return !removed.empty();
  }));
  EXPECT_THAT(removed, HasSubstr("removed to keep the quota"));
  EXPECT_TRUE(recorder->state().recording);
  EXPECT_FALSE(fs::exists(first.value())) << "the oldest goes first";
}

}  // namespace

}  // namespace railfix::recorder
