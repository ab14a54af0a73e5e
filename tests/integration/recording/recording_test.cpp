// The recorder, `railfix replay` and `railfix topics` as real processes: what is replayed is recorded again unchanged.
#include <gmock/gmock.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>

#include "core/time.hpp"
#include "mcap/reader.hpp"
#include "mcap/writer.hpp"
#include "messaging/topics.hpp"
#include "pictures/encode.hpp"
#include "support/mcap_records.hpp"
#include "support/network.hpp"
#include "support/program.hpp"
#include "support/run_until.hpp"

namespace railfix {

namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

constexpr int kSteps = 400;
constexpr int64_t kStepNs = 5'000'000;
constexpr int kPictures = 20;
constexpr int64_t kPictureNs = 100'000'000;
const std::string kDomain = "82";

class RecordingTest : public ::testing::Test {
 protected:
  RecordingTest()
      : train_(std::string("recording-") + std::to_string(getpid())),
        folder_(fs::temp_directory_path() / ("railfix-" + train_)) {
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  ~RecordingTest() override { fs::remove_all(folder_); }

  [[nodiscard]] fs::path source() const {
    auto writer = mcap::Writer::create(folder_ / "source.mcap", {}).value();
    const auto channel = [&](const std::string& topic, const messaging::Type& type) {
      const uint16_t schema = writer->add_schema(type.name(), "omgidl", "").value();
      return writer->add_channel(schema, topic, "cdr", {}).value();
    };
    const auto write = [&](uint16_t id, int64_t time_ns, const std::vector<uint8_t>& cdr) {
      EXPECT_TRUE(writer->write({id, 0, kBegin + time_ns, kBegin + time_ns, cdr}).ok());
    };
    const uint16_t odometry = channel("odometry_step", messaging::type_of<msg::OdometryStep>());
    for (int i = 0; i < kSteps; ++i) {
      msg::OdometryStep step;
      step.stamp_ns(i);
      step.distance_m(0.5 * i);
      write(odometry, i * kStepNs, messaging::serialize(step));
    }
    const uint16_t camera = channel("camera_frame/cam0", messaging::type_of<msg::CameraPreview>());
    for (int i = 0; i < kPictures; ++i) {
      msg::CameraPreview picture;
      picture.seq(static_cast<uint64_t>(i));
      const std::vector<uint8_t> pixels(640 * 480, static_cast<uint8_t>(10 * i));
      picture.jpeg(pictures::encode_jpeg(pixels.data(), 640, 480, 95).value());
      write(camera, i * kPictureNs, messaging::serialize(picture));
    }
    const uint16_t control = channel("service_control", messaging::type_of<msg::ControlRequest>());
    msg::ControlRequest stop;
    stop.service("*");
    stop.command("stop");
    write(control, kPictureNs, messaging::serialize(stop));
    const auto status = writer->close();
    EXPECT_TRUE(status.ok());
    return folder_ / "source.mcap";
  }

  [[nodiscard]] std::vector<std::string> recorder(const std::vector<std::string>& more = {}) const {
    std::vector<std::string> arguments{"railfix-recorder",         "--set", "common.train_id=" + train_, "--set",
                                       "common.domain=" + kDomain, "--set", "recorder.keep_free_mb=0"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return arguments;
  }
  [[nodiscard]] test::Program::Options log() const { return {folder_ / "recorder.log", {}, {}}; }
  [[nodiscard]] test::Outcome railfix(std::vector<std::string> arguments) const {
    arguments.insert(arguments.begin(), "railfix");
    arguments.insert(arguments.end(), {"--train", train_, "--domain", kDomain});
    return test::run_program(arguments, 60);
  }
  void wait_for_recorder() const {
    const auto status = railfix({"topics", "echo", "service_status", "--count", "1", "--for", "30", "--json"});
    ASSERT_EQ(status.exit_code, 0) << status.err;
    EXPECT_EQ(nlohmann::json::parse(status.out)["service"], "recorder");
  }

  template <class Condition>
  void wait_until(Condition condition) const {
    const int64_t deadline_ns = core::monotonic_ns() + 60 * core::kNsPerSecond;
    while (!condition()) {
      ASSERT_LT(core::monotonic_ns(), deadline_ns) << test::slurp(folder_ / "recorder.log");
      usleep(10'000);
    }
  }

  /// It records meanwhile.
  void wait_for_recovery() const {
    wait_until(
        [&] { return test::slurp(folder_ / "recorder.log").find("what it held is now in") != std::string::npos; });
  }

  /// Whole ones, two more than there are now: what had come before is in them.
  void wait_for_two_chunks(const fs::path& active) const {
    const auto chunks = [&] {
      return std::ranges::count(test::record_ends(test::bytes_of_file(active)),
                                static_cast<uint8_t>(mcap::Opcode::chunk), &test::RecordEnd::opcode);
    };
    const auto before = chunks();
    wait_until([&] { return chunks() >= before + 2; });
  }

  static constexpr int64_t kBegin = 1'700'000'000 * core::kNsPerSecond;
  std::string train_;
  fs::path folder_;
};

TEST_F(RecordingTest, WhatIsReplayedIsRecordedAgain) {
  const auto recording = folder_ / "again.mcap";
  test::Program recorder_program(recorder({"--set", "recorder.file=" + recording.string()}), log());
  wait_for_recorder();
  test::Program hz({"railfix", "topics", "hz", "odometry_step", "--json", "--count", std::to_string(kSteps * 7 / 8),
                    "--for", "60", "--train", train_, "--domain", kDomain},
                   {folder_ / "hz.json", folder_ / "hz.err", {}});
  const auto replayed = railfix({"replay", source().string()});
  EXPECT_EQ(replayed.exit_code, 0) << replayed.err;
  EXPECT_THAT(replayed.out, HasSubstr(std::to_string(kSteps + kPictures) + " samples of 2 topics"));
  EXPECT_EQ(hz.wait_for_end(), 0);
  EXPECT_NEAR(nlohmann::json::parse(test::slurp(folder_ / "hz.json"))["rate_hz"].get<double>(), 200, 40);
  EXPECT_EQ(recorder_program.end(SIGTERM), 0) << test::slurp(folder_ / "recorder.log");

  auto reader = mcap::Reader::open(recording).value();
  EXPECT_TRUE(reader->indexed()) << "SIGTERM closes the file properly";
  int steps = 0;
  int pictures = 0;
  std::vector<double> gap_errors_ms;
  int64_t last_ns = 0;
  reader->for_each({}, [&](const mcap::Channel& channel, const mcap::Message& message) {
    const std::vector<uint8_t> cdr(message.data.begin(), message.data.end());
    EXPECT_NE(channel.topic, "service_control") << "commands of the past are not given again";
    if (channel.topic == "odometry_step") {
      msg::OdometryStep step;
      EXPECT_TRUE(messaging::deserialize(cdr, step));
      EXPECT_EQ(step.distance_m(), 0.5 * steps);
      const double gap_ms = 1e3 * core::seconds(message.publish_time_ns - last_ns - kStepNs);
      if (steps++ > 0) gap_errors_ms.push_back(std::abs(gap_ms));
      last_ns = message.publish_time_ns;
    } else if (channel.topic == "camera_frame/cam0") {
      msg::CameraPreview picture;
      EXPECT_TRUE(messaging::deserialize(cdr, picture));
      const cv::Mat pixels = cv::imdecode(picture.jpeg(), cv::IMREAD_GRAYSCALE);
      EXPECT_EQ(pixels.size(), cv::Size(640, 480));
      EXPECT_NEAR(pixels.at<uint8_t>(240, 320), 10.0 * static_cast<double>(picture.seq()), 2);
      ++pictures;
    }
    return true;
  });
  EXPECT_EQ(steps, kSteps);
  EXPECT_EQ(pictures, kPictures);
  ASSERT_FALSE(gap_errors_ms.empty());
  std::ranges::sort(gap_errors_ms);
  const double p50_ms = gap_errors_ms[gap_errors_ms.size() / 2];
  const double p99_ms = gap_errors_ms[gap_errors_ms.size() * 99 / 100];
  std::printf("replayed gaps differ from the recorded ones by p50 %.3f ms, p99 %.3f ms\n", p50_ms, p99_ms);
  EXPECT_LT(p50_ms, 1.0);
}

TEST_F(RecordingTest, AFileThatCannotBeClosedIsExitCodeOne) {
  const auto recording = folder_ / "ride.mcap";
  const fs::path train = folder_ / "nowhere.yaml";
  test::Program program(
      recorder({"--set", "recorder.file=" + recording.string(), "--set", "recorder.train_file=" + train.string()}),
      log());
  wait_for_recorder();
  fs::create_directories(recording / "in its place");
  EXPECT_EQ(program.end(SIGTERM), 1);
  const std::string said = test::slurp(folder_ / "recorder.log");
  EXPECT_THAT(said, HasSubstr("ride.mcap.active: cannot be renamed to "));
  EXPECT_THAT(said, HasSubstr("the recording could not be closed: see the error before"));
  EXPECT_THAT(said, HasSubstr(train.string() + " cannot be read, so recordings will not say which it was"));
}

TEST_F(RecordingTest, AKilledRecorderLosesNoWrittenChunk) {
  const fs::path records = folder_ / "killed";
  const std::vector<std::string> settings{"--set", "recorder.folder=" + records.string(), "--set",
                                          "recorder.chunk_age_s=0.05"};
  test::Program killed(recorder(settings), log());
  wait_for_recorder();
  const auto replayed = railfix({"replay", source().string(), "--topics", "odometry_step", "--rate", "4"});
  ASSERT_EQ(replayed.exit_code, 0) << replayed.err;
  wait_for_two_chunks(fs::directory_iterator(records)->path());
  EXPECT_EQ(killed.end(SIGKILL), 128 + SIGKILL);

  test::Program next(recorder(settings), log());
  wait_for_recorder();
  wait_for_recovery();
  EXPECT_EQ(next.end(SIGTERM), 0);
  fs::path recovered;
  for (const auto& entry : fs::directory_iterator(records)) {
    if (entry.path().stem().string().ends_with("-recovered")) recovered = entry.path();
  }
  ASSERT_FALSE(recovered.empty()) << test::slurp(folder_ / "recorder.log");
  auto reader = mcap::Reader::open(recovered).value();
  EXPECT_TRUE(reader->indexed());
  int steps = 0;
  reader->for_each({{"odometry_step"}, {}, {}},
                   [&](const mcap::Channel&, const mcap::Message&) { return ++steps > 0; });
  EXPECT_EQ(steps, kSteps);
}

TEST_F(RecordingTest, KilledWhileItWritesItKeepsEveryWholeChunk) {
  const std::vector<std::string> settings{"--set", "recorder.folder=" + folder_.string() + "/killed", "--set",
                                          "recorder.chunk_age_s=0.05"};
  test::Program killed(recorder(settings), log());
  wait_for_recorder();
  test::Program replay(
      {"railfix", "replay", source().string(), "--topics", "odometry_step", "--train", train_, "--domain", kDomain},
      {folder_ / "replay.log", {}, {}});
  const fs::path active = fs::directory_iterator(folder_ / "killed")->path();
  ASSERT_EQ(active.extension(), ".active");
  size_t written = 0;
  wait_until([&] {
    const auto ends = test::record_ends(test::bytes_of_file(active));
    written = ends.empty() ? 0 : ends.back().messages;
    return written >= kSteps / 4;
  });
  ASSERT_FALSE(HasFatalFailure());
  const auto refused = test::run_program({"railfix", "recording", "repair", active.string()}, 60);
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_THAT(refused.err, HasSubstr("is being written by a recorder now"));
  EXPECT_EQ(killed.end(SIGKILL), 128 + SIGKILL);
  const size_t whole = test::record_ends(test::bytes_of_file(active)).back().messages;
  EXPECT_GE(whole, written);

  const auto out = folder_ / "repaired.mcap";
  const auto repaired =
      test::run_program({"railfix", "recording", "repair", active.string(), "--out", out.string()}, 60);
  EXPECT_EQ(repaired.exit_code, 0) << repaired.err;
  EXPECT_THAT(repaired.out, HasSubstr(": " + std::to_string(whole) + " samples of "));
  EXPECT_TRUE(mcap::Reader::open(out).value()->indexed());
  const auto again = test::run_program({"railfix", "recording", "repair", out.string()}, 60);
  EXPECT_EQ(again.exit_code, 0);
  EXPECT_THAT(again.out, HasSubstr("nothing to repair"));

  test::Program next(recorder(settings), log());
  wait_for_recorder();
  wait_for_recovery();
  const fs::path recovered = mcap::recovered_name(active);
  ASSERT_TRUE(fs::exists(recovered)) << test::slurp(folder_ / "recorder.log");
  EXPECT_EQ(mcap::Reader::open(recovered).value()->statistics().messages, whole);
  EXPECT_EQ(next.end(SIGTERM), 0);
}

TEST_F(RecordingTest, IsLedOverDdsAndSaysHowItIs) {
  messaging::Participant participant(test::network(train_, std::stoi(kDomain)));
  messaging::Queue queue;
  msg::RecorderStatus status;
  status.state(255);
  messaging::Reader<msg::RecorderStatus> statuses(participant, messaging::topics::recorder_status, "", queue,
                                                  [&](const msg::RecorderStatus& now) { status = now; });
  msg::ControlReply reply;
  messaging::Reader<msg::ControlReply> replies(participant, messaging::topics::service_reply, "", queue,
                                               [&](const msg::ControlReply& now) { reply = now; });
  messaging::Writer<msg::ControlRequest> control(participant, messaging::topics::service_control);
  test::Program recorder_program(
      recorder({"--set", "recorder.folder=" + folder_.string(), "--set", "recorder.autostart=false", "--set",
                "recorder.ring_s=5", "--set", "recorder.after_s=0"}),
      log());
  const auto until = [&](const auto& condition) { return test::run_until(queue, condition); };
  const auto state = [&](uint8_t wanted) { return until([&] { return status.state() == wanted; }); };
  uint64_t id = 0;
  const auto command = [&](const char* name, const std::string& argument = "") {
    msg::ControlRequest request;
    request.request_id(++id);
    request.service("recorder");
    request.command(name);
    request.argument(argument);
    EXPECT_TRUE(control.write(request));
    EXPECT_TRUE(until([&] { return reply.request_id() == id; })) << name;
    return reply.done();
  };
  // Its loop and its recording listen to commands.
  ASSERT_TRUE(until([&] { return control.matched_readers() == 2 && replies.matched_writers() == 1; }));
  ASSERT_TRUE(state(msg::RECORDER_WAITING)) << "it keeps a ring";
  EXPECT_FALSE(command("stop"));
  EXPECT_TRUE(command("start"));
  ASSERT_TRUE(state(msg::RECORDER_RECORDING));
  const fs::path file = status.file().c_str();
  EXPECT_TRUE(fs::exists(file.string() + ".active"));
  EXPECT_GT(status.disk_free_mb(), 0);
  EXPECT_TRUE(command("pause"));
  ASSERT_TRUE(state(msg::RECORDER_PAUSED));
  EXPECT_FALSE(command("pause"));
  EXPECT_THAT(reply.text().c_str(), HasSubstr("is paused already"));
  EXPECT_TRUE(command("resume"));
  ASSERT_TRUE(state(msg::RECORDER_RECORDING));
  EXPECT_TRUE(command("event", "a jolt"));
  EXPECT_THAT(reply.text().c_str(), HasSubstr("-event.mcap is being made"));
  EXPECT_TRUE(until([&] { return status.protected_files() == 1 && std::string(status.event().c_str()) == "a jolt"; }));
  EXPECT_TRUE(command("protect", file.filename().string()));
  EXPECT_TRUE(until([&] { return status.protected_files() == 2; }));
  const auto told = railfix({"tell", "recorder", "stop"});
  EXPECT_EQ(told.exit_code, 0) << told.err;
  EXPECT_THAT(told.out, HasSubstr(file.string()));
  ASSERT_TRUE(state(msg::RECORDER_WAITING));
  EXPECT_EQ(railfix({"tell", "recorder", "stop"}).exit_code, 1) << "the service says no";
  EXPECT_TRUE(command("unprotect", file.filename().string()));
  EXPECT_TRUE(until([&] { return status.protected_files() == 1; }));
  EXPECT_FALSE(command("unprotect", "no-such-recording"));
  EXPECT_THAT(reply.text().c_str(), HasSubstr("there is no recording"));
  EXPECT_EQ(recorder_program.end(SIGTERM), 0) << test::slurp(folder_ / "recorder.log");
  auto reader = mcap::Reader::open(file).value();
  EXPECT_TRUE(reader->indexed());
  EXPECT_TRUE(std::ranges::any_of(reader->metadata(), [](const mcap::Metadata& metadata) {
    return metadata.name == "railfix_event" && metadata.entries.at("text") == "a jolt";
  }));
}

TEST_F(RecordingTest, ReplayRefusesWhatCannotBeMeant) {
  const auto missing = railfix({"replay", (folder_ / "none.mcap").string()});
  EXPECT_EQ(missing.exit_code, 2);
  EXPECT_THAT(missing.err, HasSubstr("cannot be read"));
  const auto topic = railfix({"replay", source().string(), "--topics", "imu_sample"});
  EXPECT_EQ(topic.exit_code, 2);
  EXPECT_THAT(topic.err,
              HasSubstr("has no topic imu_sample; there are: odometry_step, camera_frame/cam0, service_control"));
  messaging::Participant running(test::network(train_, std::stoi(kDomain)));
  messaging::Writer<msg::OdometryStep> writer(running, messaging::topics::odometry_step);
  const auto second = railfix({"replay", (folder_ / "source.mcap").string()});
  EXPECT_EQ(second.exit_code, 2);
  EXPECT_THAT(second.err, HasSubstr("is running: odometry_step has a writer already"));
}

TEST_F(RecordingTest, TopicsHelpWithNames) {
  const auto wrong = railfix({"topics", "echo", "train_sate"});
  EXPECT_EQ(wrong.exit_code, 2);
  EXPECT_THAT(wrong.err, HasSubstr("did you mean train_state"));
  const auto command = railfix({"recording", "expotr"});
  EXPECT_EQ(command.exit_code, 2);
  EXPECT_THAT(command.err, HasSubstr("railfix recording: there is no command 'expotr'; did you mean export?"));
  messaging::Participant running(test::network(train_, std::stoi(kDomain)));
  messaging::Writer<msg::GnssFix> writer(running, messaging::topics::gnss_fix);
  const auto list = railfix({"topics", "list", "--json", "--for", "5"});
  ASSERT_EQ(list.exit_code, 0) << list.err;
  const auto json = nlohmann::json::parse(list.out);
  ASSERT_EQ(json.size(), 1U);
  EXPECT_EQ(json[0]["topic"], "gnss_fix");
  EXPECT_EQ(json[0]["type"], "railfix::msg::GnssFix");
  EXPECT_EQ(json[0]["writers"], 1);
}

TEST_F(RecordingTest, EchoTellsWhatWasSaidBeforeItListened) {
  messaging::Participant running(test::network(train_, std::stoi(kDomain)));
  messaging::Writer<msg::TrainPositionReport> writer(running, messaging::topics::train_position_report);
  ASSERT_TRUE(writer.write({}));
  const auto old = railfix({"topics", "echo", "train_position_report", "--count", "1", "--for", "30"});
  ASSERT_EQ(old.exit_code, 0) << old.err;
  EXPECT_THAT(old.out, ::testing::ContainsRegex("^sent [0-9.]+ s before listening:\n"));
  const auto json = railfix({"topics", "echo", "train_position_report", "--count", "1", "--for", "30", "--json"});
  EXPECT_GT(nlohmann::json::parse(json.out)["sent_before_listening_s"].get<double>(), 0);

  test::Program echo({"railfix", "topics", "echo", "train_position_report", "--count", "2", "--for", "60", "--train",
                      train_, "--domain", kDomain},
                     {folder_ / "echo", {}, {}});
  while (!echo.exit_code() && !test::slurp(folder_ / "echo").ends_with("---\n")) usleep(10'000);
  ASSERT_TRUE(writer.write({}));
  EXPECT_EQ(echo.wait_for_end(), 0);
  const auto both = test::slurp(folder_ / "echo");
  EXPECT_EQ(both.find("before listening"), both.rfind("before listening")) << "the second is new";
}

}  // namespace

}  // namespace railfix
