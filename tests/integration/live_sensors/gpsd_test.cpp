// sensor_gateway as a program with the real gpsd, which reads NMEA from a receiver on a pseudo-terminal.
#include <atomic>
#include <cmath>
#include <ctime>
#include <thread>

#include "core/time.hpp"
#include "live_sensors.hpp"
#include "support/loopback.hpp"

namespace railfix {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
const char* const kGpsd = "/usr/sbin/gpsd";
constexpr int64_t kPeriodNs = 200'000'000;

/// A receiver that goes north by 0.001 minutes each epoch, beginning at 46 degrees at the Unix time `origin_s`.
class Receiver {
 public:
  Receiver(const std::filesystem::path& name, int64_t origin_ns, bool has_fix = true)
      : line_(name), origin_ns_(origin_ns), has_fix_(has_fix), thread_([this] { run(); }) {}
  ~Receiver() {
    stop_ = true;
    thread_.join();
  }
  Receiver(const Receiver&) = delete;
  Receiver& operator=(const Receiver&) = delete;
  /// Where it is at that time.
  static double lat_deg(int64_t since_origin_ns) {
    return 46 + static_cast<double>(since_origin_ns / kPeriodNs) * 0.001 / 60;
  }

 private:
  void run() {
    int64_t epoch_ns = core::wall_ns() / kPeriodNs * kPeriodNs;
    while (!stop_) {
      epoch_ns += kPeriodNs;
      std::this_thread::sleep_for(std::chrono::nanoseconds(epoch_ns - core::wall_ns()));  // its rate
      line_.read_away();
      say(epoch_ns);
    }
  }
  void say(int64_t epoch_ns) const {
    const time_t second = epoch_ns / core::kNsPerSecond;
    tm utc{};
    gmtime_r(&second, &utc);
    char time[32];
    char date[32];
    std::snprintf(time, sizeof time, "%02d%02d%02d.%02d", utc.tm_hour, utc.tm_min, utc.tm_sec,
                  static_cast<int>(epoch_ns % core::kNsPerSecond / 10'000'000));
    std::snprintf(date, sizeof date, "%02d%02d%02d", utc.tm_mday, utc.tm_mon + 1, utc.tm_year % 100);
    char place[64];
    std::snprintf(place, sizeof place, "46%08.5f,N,00730.00000,E", (lat_deg(epoch_ns - origin_ns_) - 46) * 60);
    const std::string at = has_fix_ ? place : ",,,";
    sentence(std::string("GPRMC,") + time + (has_fix_ ? ",A," : ",V,") + at + (has_fix_ ? ",050.0,000.0," : ",,,") +
             date + ",,," + (has_fix_ ? "A" : "N"));
    sentence(std::string("GPGGA,") + time + "," + at +
             (has_fix_ ? ",1,08,1.30,545.4,M,48.0,M,," : ",0,00,99.99,,,,,,"));
    sentence(has_fix_ ? "GPGSA,A,3,04,05,09,12,17,24,28,31,,,,,2.10,1.30,1.70"
                      : "GPGSA,A,1,,,,,,,,,,,,,99.99,99.99,99.99");
    sentence("GPGSV,1,1,04,04,40,083,46,05,17,308,41,09,07,344,39,12,22,228,45");
  }
  void sentence(const std::string& text) const {
    unsigned sum = 0;
    for (const char c : text) sum ^= static_cast<unsigned char>(c);
    char end[8];
    std::snprintf(end, sizeof end, "*%02X\r\n", sum);
    line_.write("$" + text + end);
  }
  test::PseudoTerminal line_;
  int64_t origin_ns_;
  bool has_fix_;
  std::atomic<bool> stop_ = false;
  std::thread thread_;
};

class Gpsd : public LiveSensors {
 protected:
  void SetUp() override {
    TemporaryFolder::SetUp();
    if (!std::filesystem::exists(kGpsd)) GTEST_SKIP() << "gpsd is not installed";
    std::filesystem::permissions(root_, std::filesystem::perms::all);  // gpsd gives up being root
  }
  void TearDown() override {
    std::filesystem::remove(socket_);
    TemporaryFolder::TearDown();
  }
  std::unique_ptr<test::Program> gpsd(const std::vector<std::string>& receivers) const {
    std::vector<std::string> command{kGpsd, "-N", "-n", "-b", "-S", std::to_string(port_), "-F", socket_};
    command.insert(command.end(), receivers.begin(), receivers.end());
    return std::make_unique<test::Program>(command);
  }
  [[nodiscard]] std::string source() const {
    return "sensor_gateway.live.gnss=gpsd://127.0.0.1:" + std::to_string(port_);
  }
  [[nodiscard]] std::string device(const char* name) const { return (root_ / name).string(); }
  /// What udev does when a receiver is plugged in ("add") or unplugged ("remove").
  void udev(const char* action, const std::string& receiver) const {
    setenv("GPSD_SOCKET", socket_.c_str(), 1);
    EXPECT_EQ(test::run_program({"/usr/sbin/gpsdctl", action, receiver}, 10).exit_code, 0);
  }
  bool more_fixes(size_t count) {
    const size_t before = fixes_.size();
    return run_until([&] { return fixes_.size() >= before + count && status_.state() == msg::STATE_ACTIVE; });
  }
  void expect_right_places() const {
    for (const auto& fix : fixes_) {
      const double lat_deg = Receiver::lat_deg(fix.stamp_ns() - origin_ns_);
      const double step_deg = 0.001 / 60;
      EXPECT_NEAR(fix.lat_deg(), lat_deg, 5.01 * step_deg) << fix.seq();
      EXPECT_NEAR(fix.lon_deg(), 7.5, 1e-7);
      EXPECT_NEAR(fix.hdop(), 1.3, 0.01);
      EXPECT_EQ(fix.fix(), msg::GNSS_SINGLE);
      if (std::isnan(fix.alt_m())) continue;  // gpsd may tell it a sentence later
      EXPECT_NEAR(fix.alt_m(), 545.4, 0.1);
    }
  }
  const int port_ = test::free_port();
  const std::string socket_ = "/tmp/railfix-gpsd-" + std::to_string(getpid());
  const int64_t origin_ns_ = core::wall_ns() / kPeriodNs * kPeriodNs;
};

TEST_F(Gpsd, AReceiverThatComesGoesAndComesBack) {
  const auto service = gateway({source(), "sensor_gateway.live.gnss_latency_ms=0", "sensor_gateway.live.silent_s=1.5"});
  ASSERT_TRUE(told("cannot be reached")) << reason();
  EXPECT_THAT(reason(),
              AllOf(HasSubstr("gpsd://127.0.0.1:" + std::to_string(port_)), HasSubstr("check that gpsd runs")));

  auto receiver = std::make_unique<Receiver>(device("gnss"), origin_ns_);
  auto daemon = gpsd({device("gnss")});
  ASSERT_TRUE(more_fixes(10)) << reason();

  receiver.reset();
  udev("remove", device("gnss"));
  ASSERT_TRUE(told("has no receiver; check that it is plugged in")) << reason();
  receiver = std::make_unique<Receiver>(device("gnss"), origin_ns_);
  udev("add", device("gnss"));
  ASSERT_TRUE(more_fixes(10)) << reason();

  daemon.reset();
  ASSERT_TRUE(told("127.0.0.1:" + std::to_string(port_))) << reason();
  daemon = gpsd({device("gnss")});
  ASSERT_TRUE(more_fixes(10)) << reason();

  expect_growing(fixes_);
  expect_right_places();
  EXPECT_EQ(service->end(SIGTERM), 0);
}

TEST_F(Gpsd, AReceiverWithoutAPositionSaysSo) {
  const Receiver receiver(device("gnss"), origin_ns_, false);
  const auto daemon = gpsd({device("gnss")});
  const auto service = gateway({source()});
  ASSERT_TRUE(run_until([this] { return fixes_.size() >= 5; })) << reason();
  for (const auto& fix : fixes_) {
    EXPECT_EQ(fix.fix(), msg::GNSS_NONE);
    EXPECT_TRUE(std::isnan(fix.lat_deg()));
  }
}

TEST_F(Gpsd, OneOfTwoReceiversHasToBeNamed) {
  const Receiver here(device("here"), origin_ns_);
  const Receiver ahead(device("ahead"), origin_ns_ - 1000 * kPeriodNs);
  const auto daemon = gpsd({device("here"), device("ahead")});
  {
    const auto service = gateway({source()});
    ASSERT_TRUE(told("several receivers")) << reason();
    EXPECT_THAT(reason(), AllOf(HasSubstr(device("here")), HasSubstr(device("ahead"))));
    EXPECT_EQ(service->end(SIGTERM), 0);
  }
  EXPECT_TRUE(fixes_.empty());
  {
    const auto service = gateway({source() + device("nowhere")});
    ASSERT_TRUE(told("has no receiver " + device("nowhere"))) << reason();
    EXPECT_EQ(service->end(SIGTERM), 0);
  }
  EXPECT_TRUE(fixes_.empty());
  const auto service = gateway({source() + device("here"), "sensor_gateway.live.gnss_latency_ms=0"});
  ASSERT_TRUE(more_fixes(5)) << reason();
  expect_right_places();
}

/// An address that swallows what is sent to it: connecting hangs.
TEST_F(Gpsd, AnAddressThatDoesNotAnswerDoesNotHoldUpTheEnd) {
  const auto service = gateway({"sensor_gateway.live.gnss=gpsd://192.0.2.1:2947"});
  ASSERT_TRUE(
      run_until([this] { return status_.state() == msg::STATE_READY || status_.state() == msg::STATE_DEGRADED; }));
  const int64_t began_ns = core::monotonic_ns();
  EXPECT_EQ(service->end(SIGTERM), 0);
  EXPECT_LT(core::seconds(core::monotonic_ns() - began_ns), 10) << "the kernel gives up after two minutes";
}

TEST_F(Gpsd, WhatIsNoReceiverIsExitCodeTwo) {
  for (const char* source : {"", "gpsd://", "gpsd://train.example:2947", "gpsd://127.0.0.1", "/dev/ttyACM0"}) {
    EXPECT_EQ(gateway({std::string("sensor_gateway.live.gnss=") + source})->wait_for_end(), 2) << source;
  }
  EXPECT_EQ(gateway({source(), "sensor_gateway.clock=own"})->wait_for_end(), 2);
}

}  // namespace
}  // namespace railfix
