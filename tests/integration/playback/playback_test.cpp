// frame_grabber and sensor_gateway as programs, over DDS, with this test as the third in lock step.
#include <gmock/gmock.h>

#include <cstdlib>
#include <fstream>
#include <map>

#include "core/time.hpp"
#include "messaging/connected.hpp"
#include "messaging/topics.hpp"
#include "support/on_train.hpp"
#include "support/program.hpp"
#include "unit/dataset/temporary_folder.hpp"

namespace railfix {
namespace {

using ::testing::HasSubstr;
namespace topics = messaging::topics;

constexpr int kDomain = 81;
constexpr int kPictures = 40;
constexpr int64_t kPictureNs = 20'000'000;
constexpr int64_t kImuNs = 5'000'000;
constexpr size_t kImuSamples = (kPictures - 1) * kPictureNs / kImuNs + 1;  // up to the last picture

class Playback : public railfix::testing::TemporaryFolder, protected test::OnTrain {
 protected:
  Playback()
      : OnTrain("playback-" + std::to_string(getpid()), kDomain),
        progress_(participant_, topics::data_progress),
        control_(participant_, topics::service_control) {
    listen(topics::data_clock, [this](const msg::DataClock& clock) { take(clock); });
    listen(topics::imu_sample, [this](const msg::ImuSample& sample) { imu_.push_back(sample.stamp_ns()); });
    listen(topics::wheel_sample, [this](const msg::WheelSample& sample) { wheel_.push_back(sample.pulses()); });
    listen(
        topics::camera_frame, [this](const msg::CameraFrame& frame) { take(frame); }, "cam0");
    listen(
        topics::camera_preview, [this](const msg::CameraPreview& preview) { preview_ = preview; }, "cam0");
    listen(topics::camera_calibration,
           [this](const msg::CameraCalibration& calibration) { calibration_ = calibration; });
    listen(topics::service_status, [this](const msg::ServiceStatus& status) {
      status_[status.service().c_str()] = status;
      if (status.state() == msg::STATE_FAILED) failure_ = status.reason().c_str();
    });
  }

  void SetUp() override {
    TemporaryFolder::SetUp();
    write_ride(kPictureNs);
    write("mav0/cam0/sensor.yaml",
          "resolution: [8, 6]\nintrinsics: [9, 9, 4, 3]\n"
          "mount: {height_m: 2.2, pitch_rad: 0.1, yaw_rad: 0, roll_rad: 0, lateral_m: 0}\n");
    write("mav0/wheel0/data.csv", "#timestamp [ns],pulses\n" + std::to_string(kBeginNs + 1) + ",7\n");
    write("mav0/wheel0/sensor.yaml", "pulses_per_metre: 10\n");
  }

  void write_ride(int64_t picture_ns) const {
    std::string pictures = "#timestamp [ns],filename\n";
    for (int i = 0; i < kPictures; ++i) {
      const std::string name = std::to_string(i) + ".png";
      write_picture("mav0/cam0/data/" + name, 50 + i);
      pictures += std::to_string(kBeginNs + i * picture_ns) + "," + name + "\n";
    }
    write("mav0/cam0/data.csv", pictures);
    std::string imu = "#timestamp [ns],w_x,w_y,w_z,a_x,a_y,a_z\n";
    for (int64_t t = 0; t <= kPictures * picture_ns; t += kImuNs)
      imu += std::to_string(kBeginNs + t) + ",0,0,0,0,0,9.81\n";
    write("mav0/imu0/data.csv", imu);
  }

  [[nodiscard]] std::vector<std::string> common(const std::string& service) const {
    return {"common.train_id=" + train_, "common.domain=" + std::to_string(kDomain), "common.log_level=error",
            service + ".source=" + root_.string(), service + ".at_end=finish"};
  }
  std::unique_ptr<test::Program> gateway(bool lock_step) {
    auto sets = common("sensor_gateway");
    if (lock_step) sets.push_back("common.lock_step=true");
    return std::make_unique<test::Program>(test::with_settings("railfix-sensor-gateway", sets));
  }
  std::unique_ptr<test::Program> grabber(std::vector<std::string> more) {
    auto sets = common("frame_grabber");
    sets.insert(sets.end(), more.begin(), more.end());
    return std::make_unique<test::Program>(test::with_settings("railfix-frame-grabber", sets));
  }

  /// Both services are ready and everyone has found everyone.
  bool connected() { return status_.size() == 2 && messaging::all_connected(participant_.connections(), status_); }
  void start() {
    msg::ControlRequest request;
    request.service("frame_grabber");
    request.command("start");
    control_.write(request);
  }
  void take(const msg::CameraFrame& frame) {
    frames_.push_back({frame.seq(), frame.stamp_ns(), frame.health(), frame.data()[0]});
    answer();
  }
  void take(const msg::DataClock& clock) {
    clocks_.push_back(clock);
    if (!answers_ || std::string(clock.turn().c_str()) != "tester") return;
    turn_ = clock;
    answer();
  }
  /// As services do: when every picture that was sent is here.
  void answer() {
    if (!turn_ || frames_.size() < sent(*turn_, "camera_frame/cam0")) return;
    msg::DataProgress progress;
    progress.service("tester");
    progress.seq(turn_->seq());
    progress_.write(progress);
    turn_.reset();
  }

  static uint64_t sent(const msg::DataClock& clock, const std::string& topic) {
    for (const auto& one : clock.sent()) {
      if (topic == one.topic().c_str()) return one.samples();
    }
    return 0;
  }

  struct Frame {
    uint64_t seq;
    int64_t stamp_ns;
    uint32_t health;
    int grey;
  };
  static constexpr int64_t kBeginNs = 1'700'000'000'000'000'000;
  messaging::Writer<msg::DataProgress> progress_;
  messaging::Writer<msg::ControlRequest> control_;
  std::vector<msg::DataClock> clocks_;
  std::vector<Frame> frames_;
  std::vector<int64_t> imu_;
  std::vector<int64_t> wheel_;
  std::map<std::string, msg::ServiceStatus> status_;
  std::optional<msg::CameraPreview> preview_;
  std::optional<msg::CameraCalibration> calibration_;
  std::string failure_;
  std::optional<msg::DataClock> turn_;  // of the tester, not yet answered
  bool answers_ = true;
};

TEST_F(Playback, LosslessGivesEveryPictureAndSampleOnceAndEnds) {
  const auto sensors = gateway(true);
  const auto pictures = grabber({"frame_grabber.pace=lossless", "frame_grabber.wait_for=[sensor_gateway, tester]"});
  ASSERT_TRUE(run_until([&] { return connected(); }));
  start();
  ASSERT_TRUE(run_until([&] { return pictures->exit_code() && sensors->exit_code(); }));
  EXPECT_EQ(pictures->exit_code(), 0);
  EXPECT_EQ(sensors->exit_code(), 0);
  ASSERT_TRUE(run_until([&] {
    return imu_.size() >= kImuSamples && frames_.size() >= kPictures && clocks_.size() > 2 * kPictures && preview_;
  })) << imu_.size();
  ASSERT_EQ(frames_.size(), size_t{kPictures});
  for (size_t i = 0; i < frames_.size(); ++i) {
    EXPECT_EQ(frames_[i].seq, i + 1);
    EXPECT_EQ(frames_[i].stamp_ns, kBeginNs + static_cast<int64_t>(i) * kPictureNs);
    EXPECT_EQ(frames_[i].grey, 50 + static_cast<int>(i));
    EXPECT_EQ(frames_[i].health, 0U);
  }
  ASSERT_EQ(imu_.size(), kImuSamples);
  for (size_t i = 0; i < imu_.size(); ++i) EXPECT_EQ(imu_[i], kBeginNs + static_cast<int64_t>(i) * kImuNs);
  EXPECT_THAT(wheel_, ::testing::ElementsAre(7));
  ASSERT_EQ(clocks_.size(), size_t{2 * kPictures + 1});  // two turns a picture, and the end
  for (size_t i = 0; i < 2 * kPictures; ++i) {
    EXPECT_EQ(clocks_[i].seq(), i / 2 + 1);
    EXPECT_EQ(std::string(clocks_[i].turn().c_str()), i % 2 == 0 ? "sensor_gateway" : "tester");
  }
  EXPECT_EQ(sent(clocks_[0], "camera_frame/cam0"), 1U);
  EXPECT_EQ(sent(clocks_[1], "imu_sample"), 1U);
  EXPECT_EQ(sent(clocks_[2 * kPictures - 1], "imu_sample"), kImuSamples);
  EXPECT_EQ(clocks_.back().ended(), 1);
  EXPECT_EQ(clocks_.back().data_ns(), frames_.back().stamp_ns);
  ASSERT_TRUE(calibration_);
  EXPECT_TRUE(calibration_->mount_known());
  EXPECT_EQ(calibration_->height_m(), 2.2);
  ASSERT_TRUE(preview_);
  EXPECT_EQ(preview_->width_px(), 8U);
}

TEST_F(Playback, LosslessNamesWhoDoesNotAnswer) {
  answers_ = false;
  const auto sensors = gateway(true);
  const auto pictures = grabber(
      {"frame_grabber.pace=lossless", "frame_grabber.wait_for=[sensor_gateway, tester]", "frame_grabber.wait_s=3"});
  ASSERT_TRUE(run_until([&] { return connected(); }));
  start();
  ASSERT_TRUE(run_until([&] { return pictures->exit_code().has_value(); }));
  EXPECT_EQ(pictures->exit_code(), 1);
  ASSERT_TRUE(run_until([this] { return !failure_.empty(); }));
  EXPECT_THAT(failure_, HasSubstr("no answer on data_progress from tester for 3 s at picture 1"));
  EXPECT_EQ(frames_.size(), 1U);
}

// If it waited for wait_s the test would fail.
TEST_F(Playback, BegunImmediatelyItWaitsOnlyUntilEveryoneIsThere) {
  const auto pictures = grabber({"frame_grabber.pace=lossless", "frame_grabber.start=immediately",
                                 "frame_grabber.wait_for=[sensor_gateway]", "frame_grabber.wait_s=3600"});
  ASSERT_TRUE(run_until([&] { return status_.contains("frame_grabber"); }));
  const auto sensors = gateway(true);
  ASSERT_TRUE(run_until([&] { return pictures->exit_code() && sensors->exit_code(); }));
  EXPECT_EQ(pictures->exit_code(), 0) << "a service without an answer to every picture would be 1";
  EXPECT_EQ(sensors->exit_code(), 0);
}

// How many pictures are late is up to the machine; that none comes early and none is forgotten is not.
TEST_F(Playback, RealPaceTakesAtLeastAsLongAsTheRecordingAndCountsEveryPicture) {
  const auto sensors = gateway(false);
  const auto pictures = grabber({"frame_grabber.pace=real", "frame_grabber.at_end=idle"});
  ASSERT_TRUE(run_until([&] { return connected(); }));
  const int64_t begin_ns = core::monotonic_ns();
  start();
  ASSERT_TRUE(run_until([&] { return !clocks_.empty() && clocks_.back().ended() != 0; }));
  EXPECT_GE(core::monotonic_ns() - begin_ns, (kPictures - 1) * kPictureNs);
  const auto& status = status_["frame_grabber"];
  EXPECT_TRUE(run_until([&] { return status.frames_out() + status.dropped() == kPictures; }))
      << status.frames_out() << " sent, " << status.dropped() << " dropped";
  EXPECT_GT(frames_.size(), 0U);
  EXPECT_LE(frames_.size(), status.frames_out());
  ASSERT_TRUE(run_until([&] { return sensors->exit_code().has_value(); }));
  EXPECT_TRUE(run_until([&] { return imu_.size() >= kImuSamples; })) << imu_.size();
}

TEST_F(Playback, WhoIsStartedAnewAndTheOtherPlayTheSameTime) {
  constexpr int64_t kSecondNs = core::kNsPerSecond;
  write_ride(25 * kPictureNs);
  const std::vector<std::string> real{"frame_grabber.pace=real", "frame_grabber.start=immediately"};
  auto sensors = gateway(false);
  auto pictures = grabber(real);
  ASSERT_TRUE(run_until([&] { return !imu_.empty() && imu_.back() > kBeginNs + 3 * kSecondNs; }));

  // What a killed program said last may come after its end: so the stamps are looked at, not what comes next.
  const int64_t killed_ns = imu_.back();
  sensors->end(SIGKILL);
  sensors = gateway(false);
  ASSERT_TRUE(run_until([&] { return imu_.back() > killed_ns + kSecondNs; }));
  EXPECT_TRUE(std::ranges::is_sorted(imu_)) << "a device delivers nothing from before it is asked";

  pictures->end(SIGKILL);
  pictures = grabber(real);
  const auto goes_back = [](const auto& all, auto stamp) {
    return std::ranges::adjacent_find(all, std::greater(), stamp);
  };
  ASSERT_TRUE(run_until([&] {
    return goes_back(frames_, &Frame::stamp_ns) != frames_.end() && frames_.back().stamp_ns > kBeginNs + kSecondNs;
  })) << "it begins at the front";
  ASSERT_TRUE(run_until([&] { return goes_back(imu_, std::identity()) != imu_.end(); }))
      << "the sensors go on at another time than the pictures";
  EXPECT_EQ(*std::next(goes_back(imu_, std::identity())), kBeginNs);
  EXPECT_LT(std::abs(imu_.back() - frames_.back().stamp_ns), kSecondNs);
}

/// A wall clock that the test sets for the programs that it starts meanwhile.
class SetClock {
 public:
  explicit SetClock(std::filesystem::path file) : file_(std::move(file)) {
    set_s(0);
    setenv("LD_PRELOAD", (std::filesystem::path(RAILFIX_BIN_DIR) / "railfix-clock-step.so").c_str(), 1);
    setenv("RAILFIX_CLOCK_STEP", file_.c_str(), 1);
  }
  ~SetClock() { unsetenv("LD_PRELOAD"); }
  SetClock(const SetClock&) = delete;
  SetClock& operator=(const SetClock&) = delete;
  void set_s(int64_t seconds) const {
    const int64_t ns = seconds * core::kNsPerSecond;
    std::fstream file(file_, std::ios::binary | std::ios::in | std::ios::out | std::ios::ate);
    if (!file) file.open(file_, std::ios::binary | std::ios::out);
    file.seekp(0);
    file.write(reinterpret_cast<const char*>(&ns), sizeof ns);
  }

 private:
  std::filesystem::path file_;
};

// 20 s of ride, of which a clock that is followed would leave out or wait for 15.
TEST_F(Playback, AWallClockThatIsSetMovesNothing) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "the sanitizer wants to be loaded before everything else";
#endif
  constexpr int64_t kSecondNs = core::kNsPerSecond;
  write_ride(25 * kPictureNs);
  const SetClock clock(root_ / "step");
  const auto sensors = gateway(false);
  const auto pictures = grabber({"frame_grabber.pace=real", "frame_grabber.start=immediately"});
  const int64_t begin_ns = core::monotonic_ns();
  const auto comes_to = [&](int64_t data_s) {
    return run_until([&] { return !imu_.empty() && imu_.back() > kBeginNs + data_s * kSecondNs; }) &&
           run_until([&] { return frames_.back().stamp_ns > kBeginNs + data_s * kSecondNs; });
  };
  ASSERT_TRUE(comes_to(2));
  for (const auto& [set_s, data_s] : std::map<int, int>{{-15, 5}, {15, 8}}) {
    clock.set_s(set_s);
    ASSERT_TRUE(comes_to(data_s));
    // Half of what the clock is set by: a machine that is busy is late by seconds.
    EXPECT_LT(clocks_.back().data_ns(), kBeginNs + (data_s + 8) * kSecondNs);
    EXPECT_LT(imu_.back(), kBeginNs + (data_s + 8) * kSecondNs) << "sensors go with the pictures";
    const int64_t ahead_ns = clocks_.back().wall_ns() - core::wall_ns();
    EXPECT_NEAR(core::seconds(ahead_ns), set_s, 8) << "who plays along hears what the clock says now";
  }
  const double took_s = core::seconds(core::monotonic_ns() - begin_ns);
  EXPECT_GT(took_s, 7.5);
  EXPECT_LT(took_s, 22);
}

TEST_F(Playback, WithAClockOfItsOwnTheGatewaySaysWhenThereIsNothingToPlay) {
  std::filesystem::remove_all(root_ / "mav0/imu0");
  std::filesystem::remove_all(root_ / "mav0/wheel0");
  const auto outcome = test::run_program(
      test::with_settings("railfix-sensor-gateway",
                          {"common.domain=" + std::to_string(kDomain), "sensor_gateway.source=" + root_.string(),
                           "sensor_gateway.clock=own", "sensor_gateway.start=immediately"}),
      10);
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_THAT(outcome.err, HasSubstr("has no IMU, wheel or GNSS samples to play; give a dataset folder"));
}

TEST_F(Playback, WhatCannotBePlayedIsExitCodeTwo) {
  write("mav0/cam0/sensor.yaml", "resolution: [80, 60]\nintrinsics: [9, 9, 4, 3]\n");
  const auto pictures = grabber({});
  ASSERT_TRUE(run_until([&] { return pictures->exit_code().has_value(); }));
  EXPECT_EQ(pictures->exit_code(), 2);
  write("mav0/imu0/data.csv", "#timestamp [ns],w_x,w_y,w_z,a_x,a_y,a_z\n1,2\n");
  const auto sensors = gateway(false);
  ASSERT_TRUE(run_until([&] { return sensors->exit_code().has_value(); }));
  EXPECT_EQ(sensors->exit_code(), 2);
}

}  // namespace
}  // namespace railfix
