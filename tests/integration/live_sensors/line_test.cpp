// sensor_gateway as a program with IMU and wheel on a serial line, which is a pseudo-terminal.
#include <atomic>
#include <cmath>
#include <numbers>
#include <thread>

#include "core/time.hpp"
#include "live_sensors.hpp"
#include "support/ubx_frames.hpp"

namespace railfix::line_test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
constexpr int64_t kPeriodMs = 10;

/// A u-blox receiver on a train that turns left by 1 degree/s, 3 pulses every 10 ms; its x points left, its y back. Its
/// time began at `origin_ns`.
class Receiver {
 public:
  struct Faults {
    int64_t breaks = 0;          // of so many messages of the IMU one has a bit that is wrong; 0 = of none
    int64_t wheel_after_ms = 0;  // the wheel begins to speak so long behind the IMU
  };
  Receiver(const std::filesystem::path& name, int64_t origin_ns, bool has_wheel = true)
      : Receiver(name, origin_ns, has_wheel, Faults{}) {}
  Receiver(const std::filesystem::path& name, int64_t origin_ns, bool has_wheel, Faults faults)
      : line_(name), origin_ns_(origin_ns), has_wheel_(has_wheel), faults_(faults), thread_([this] { run(); }) {}
  ~Receiver() {
    stop_ = true;
    thread_.join();
  }
  Receiver(const Receiver&) = delete;
  Receiver& operator=(const Receiver&) = delete;

 private:
  void run() {
    int64_t tag_ms = (core::wall_ns() - origin_ns_) / 1'000'000 / kPeriodMs * kPeriodMs;
    const int64_t wheel_from_ms = tag_ms + faults_.wheel_after_ms;
    while (!stop_) {
      tag_ms += kPeriodMs;
      const int64_t due_ns = origin_ns_ + tag_ms * 1'000'000;
      std::this_thread::sleep_for(std::chrono::nanoseconds(due_ns - core::wall_ns()));  // its rate
      const auto tag = static_cast<uint32_t>(tag_ms);
      std::string imu = test::ubx_measurements(tag, test::ubx_imu({0, 0, 4096}, {0, -1024, 10042}));
      if (faults_.breaks > 0 && tag_ms / kPeriodMs % faults_.breaks == 0) imu[20] = static_cast<char>(imu[20] ^ 4);
      line_.write(imu);
      if (has_wheel_ && tag_ms >= wheel_from_ms) {
        const auto ticks = static_cast<uint32_t>(tag_ms / kPeriodMs * 3);
        line_.write(test::ubx_measurements(tag, {test::ubx_ticks(0x7FFFFF - 600 + ticks, false)}));
      }
    }
  }
  test::PseudoTerminal line_;
  int64_t origin_ns_;
  bool has_wheel_;
  Faults faults_;
  std::atomic<bool> stop_ = false;
  std::thread thread_;
};

class Line : public LiveSensors {
 protected:
  void SetUp() override {
    LiveSensors::SetUp();
    listen(messaging::topics::imu_sample, [this](const msg::ImuSample& one) { imu_.push_back(one); });
    listen(messaging::topics::wheel_sample, [this](const msg::WheelSample& one) { wheel_.push_back(one); });
  }
  [[nodiscard]] std::string device() const { return (root_ / "ttyACM0").string(); }
  std::unique_ptr<test::Program> both() {
    return gateway({"sensor_gateway.live.imu=ubx:" + device(), "sensor_gateway.live.wheel=ubx:" + device(),
                    "sensor_gateway.live.wheel_pulses_per_metre=100", "sensor_gateway.live.imu_axes=-y x z",
                    "sensor_gateway.live.line_latency_ms=0", "sensor_gateway.live.silent_s=1"});
  }
  bool more(size_t count) {
    const size_t imu = imu_.size();
    const size_t wheel = wheel_.size();
    return run_until([&] {
      return imu_.size() >= imu + count && wheel_.size() >= wheel + count && status_.state() == msg::STATE_ACTIVE;
    });
  }
  void expect_imu_of_the_train() const {
    for (const auto& one : imu_) {
      EXPECT_NEAR(one.rate_z_rps(), std::numbers::pi / 180, 1e-9);
      EXPECT_NEAR(one.accel_x_mps2(), 1, 1e-9);
      EXPECT_NEAR(one.accel_y_mps2(), 0, 1e-9);
      EXPECT_NEAR(one.accel_z_mps2(), 9.81, 0.01);
    }
  }
  /// 300 pulses a second from the first on, also over a time when nobody listened.
  void expect_pulses_as_time_went() const {
    for (const auto& one : wheel_) {
      const double s = core::seconds(one.stamp_ns() - wheel_[0].stamp_ns());
      EXPECT_NEAR(static_cast<double>(one.pulses() - wheel_[0].pulses()), 300 * s, 300 * 0.5) << one.seq();
      EXPECT_EQ(one.pulses_per_metre(), 100);
    }
  }
  std::vector<msg::ImuSample> imu_;
  std::vector<msg::WheelSample> wheel_;
};

TEST_F(Line, ThatIsCutAndMended) {
  const auto service = both();
  ASSERT_TRUE(told("cannot be opened (No such file or directory)")) << reason();
  EXPECT_THAT(reason(), AllOf(HasSubstr("ubx:" + device()), HasSubstr("plugged in")));

  const int64_t origin_ns = core::wall_ns() - 3600 * core::kNsPerSecond;
  auto receiver = std::make_unique<Receiver>(device(), origin_ns);
  ASSERT_TRUE(more(150)) << reason();
  receiver.reset();
  ASSERT_TRUE(told("ubx:" + device())) << reason();
  EXPECT_THAT(reason(), ::testing::AnyOf(HasSubstr("was unplugged"), HasSubstr("cannot be opened")));
  const int64_t cut_ns = core::monotonic_ns();
  ASSERT_TRUE(run_until([&] { return core::monotonic_ns() - cut_ns > 2 * core::kNsPerSecond; }));
  receiver = std::make_unique<Receiver>(device(), origin_ns);
  ASSERT_TRUE(more(150)) << reason();

  expect_growing(imu_);
  expect_growing(wheel_);
  expect_imu_of_the_train();
  expect_pulses_as_time_went();
  EXPECT_LT(std::abs(core::seconds(imu_.back().grabbed_ns() - imu_.back().stamp_ns())), 2.0);
  EXPECT_EQ(service->end(SIGTERM), 0);
}

TEST_F(Line, AReceiverThatWasSwitchedOffHasLostItsCount) {
  const auto service = both();
  auto receiver = std::make_unique<Receiver>(device(), core::wall_ns() - 3600 * core::kNsPerSecond);
  ASSERT_TRUE(more(20)) << reason();
  receiver.reset();
  ASSERT_TRUE(told("ubx:" + device())) << reason();
  const auto before = wheel_.back();
  receiver = std::make_unique<Receiver>(device(), core::wall_ns());
  ASSERT_TRUE(more(20)) << reason();
  EXPECT_GT(wheel_.back().pulses() - before.pulses(), 1'000'000) << "a leap that no train can make";
  expect_growing(wheel_);
}

TEST_F(Line, AnImuThatSitsOtherwiseIsNotUsedAndTheWheelGoesOn) {
  const auto service =
      gateway({"sensor_gateway.live.imu=ubx:" + device(), "sensor_gateway.live.wheel=ubx:" + device(),
               "sensor_gateway.live.wheel_pulses_per_metre=100", "sensor_gateway.live.imu_axes=z x y"});
  const Receiver receiver(device(), core::wall_ns());
  ASSERT_TRUE(told("axis that points up is called forward")) << reason();
  const size_t imu = imu_.size();
  const size_t wheel = wheel_.size();
  ASSERT_TRUE(run_until([&] { return wheel_.size() > wheel + 50; }));
  EXPECT_LE(imu_.size(), imu + 5) << "what was on its way";
  EXPECT_TRUE(imu_.empty()) << "none is sent before it is judged";
}

TEST_F(Line, AWheelThatIsMissingIsSaid) {
  const auto service = both();
  const Receiver receiver(device(), core::wall_ns(), false);
  ASSERT_TRUE(told("no wheel pulses from ubx:" + device())) << reason();
  EXPECT_TRUE(run_until([this] { return imu_.size() > 10; })) << "the IMU goes on";
}

// The first sample behind it is that of one of its sensors; the other has been silent for as long as the line was.
TEST_F(Line, AnOutageOfTheWholeLineIsNoneOfItsWheel) {
  const auto service = both();
  ASSERT_TRUE(told("cannot be opened")) << reason();
  const int64_t out_ns = core::monotonic_ns();
  ASSERT_TRUE(run_until([&] { return core::monotonic_ns() - out_ns > 2 * core::kNsPerSecond; }));
  const Receiver receiver(device(), core::wall_ns(), true, {.breaks = 0, .wheel_after_ms = 500});
  bool accused = false;
  ASSERT_TRUE(run_until([&] {
    accused = accused || reason().find("no wheel pulses") != std::string::npos;
    return status_.state() == msg::STATE_ACTIVE;
  })) << reason();
  EXPECT_FALSE(accused);
}

TEST_F(Line, BrokenMessagesAreCountedAndSaid) {
  const auto service = both();
  const Receiver receiver(device(), core::wall_ns(), true, {.breaks = 10, .wheel_after_ms = 0});
  ASSERT_TRUE(told("sends broken messages (")) << reason();
  EXPECT_THAT(reason(), AllOf(HasSubstr("receiver ubx:" + device()), HasSubstr("check its cable")));
  EXPECT_TRUE(run_until([this] { return status_.dropped() >= 10 && imu_.size() > 50; })) << status_.dropped();
}

TEST_F(Line, ThatIsSilentOrSpeaksSomethingElseIsSaidAndDoesNotHoldUpTheEnd) {
  const test::PseudoTerminal line(device());
  const auto service = both();
  ASSERT_TRUE(told("sends nothing; check its power")) << reason();
  ASSERT_TRUE(run_until([&] {
    line.write(std::string("$GNRMC,,V,,,,,,,,,,N*4D\r\n"));
    return reason().find("sends what is no UBX") != std::string::npos;
  })) << reason();
  EXPECT_EQ(service->end(SIGTERM), 0);
}

TEST_F(Line, WhatCannotBeIsExitCodeTwo) {
  const std::string wheel = "sensor_gateway.live.wheel=ubx:/dev/ttyACM0";
  const std::string scale = "sensor_gateway.live.wheel_pulses_per_metre=100";
  EXPECT_EQ(gateway({wheel})->wait_for_end(), 2) << "no pulses per metre";
  EXPECT_EQ(gateway({wheel, scale, "sensor_gateway.live.baud=100000"})->wait_for_end(), 2);
  EXPECT_EQ(gateway({"sensor_gateway.live.imu=/dev/ttyACM0"})->wait_for_end(), 2);
  EXPECT_EQ(gateway({"sensor_gateway.live.imu=ubx:/dev/ttyACM0", "sensor_gateway.live.imu_axes=x y y"})->wait_for_end(),
            2);
}

/// What `railfix train check` asks of it, on a computer without any of the devices.
TEST_F(Line, ADeviceThatCannotBeIsFoundBeforeItStarts) {
  const auto asked = [](const std::string& key, const std::string& value) {
    std::vector<std::string> command =
        test::with_settings("railfix-sensor-gateway", {"sensor_gateway.source=live", key + "=" + value});
    command.emplace_back("--check");
    return test::run_program(command, 10);
  };
  EXPECT_EQ(asked("sensor_gateway.live.imu", "ubx:/dev/ttyACM0").exit_code, 0);
  EXPECT_EQ(asked("sensor_gateway.live.gnss", "gpsd://train.example:2947").exit_code, 2);
  EXPECT_THAT(asked("sensor_gateway.live.gnss", "/dev/ttyACM0").err, HasSubstr("give gpsd://ADDRESS:PORT"));
}

}  // namespace
}  // namespace railfix::line_test
