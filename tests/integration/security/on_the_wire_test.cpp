// What somebody reads who listens on the cable between two computers of a train, and what stands in the memory of one:
// real packets, two network namespaces.
#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <linux/if_ether.h>
#include <linux/if_packet.h>
#include <net/if.h>
#include <sys/socket.h>

#include <atomic>
#include <fstream>
#include <mutex>
#include <thread>

#include "messaging/topics.hpp"
#include "support/program.hpp"
#include "support/run_until.hpp"
#include "support/two_hosts.hpp"
#include "train/keys.hpp"

namespace railfix::on_the_wire_test {
namespace {

namespace fs = std::filesystem;
namespace topics = messaging::topics;
using test::TwoHosts;

constexpr int kDomain = 93;
constexpr const char* kSecret = "what only this train is to know";

/// Keeps what goes over the cab's end of the cable, as tcpdump does.
class Eavesdropper {
 public:
  Eavesdropper() : socket_(socket(AF_PACKET, SOCK_RAW | SOCK_CLOEXEC, htons(ETH_P_ALL))) {
    sockaddr_ll cable{};
    cable.sll_family = AF_PACKET;
    cable.sll_protocol = htons(ETH_P_ALL);
    cable.sll_ifindex = static_cast<int>(if_nametoindex(TwoHosts::kInterface[TwoHosts::cab]));
    const timeval patience{0, 100'000};
    setsockopt(socket_, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
    ready_ = bind(socket_, reinterpret_cast<sockaddr*>(&cable), sizeof cable) == 0;
    thread_ = std::thread([this] { listen(); });
  }
  ~Eavesdropper() {
    ended_ = true;
    thread_.join();
    close(socket_);
  }
  [[nodiscard]] bool ready() const { return ready_; }
  [[nodiscard]] std::string heard() {
    const std::lock_guard lock(mutex_);
    return heard_;
  }

 private:
  void listen() {
    std::vector<char> packet(1 << 16);
    while (!ended_) {
      const ssize_t got = recv(socket_, packet.data(), packet.size(), 0);
      if (got <= 0) continue;
      const std::lock_guard lock(mutex_);
      heard_.append(packet.data(), static_cast<size_t>(got));
    }
  }
  int socket_;
  bool ready_ = false;
  std::mutex mutex_;
  std::string heard_;
  std::atomic<bool> ended_ = false;
  std::thread thread_;
};

class OnTheWire : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!hosts_.ready()) GTEST_SKIP() << "skipped: two network namespaces need root and the program ip (iproute2)";
    fs::create_directories(folder_);
    std::ofstream(folder_ / "train.yaml")
        << "train:\n  id: " << train_ << "\n  domain: " << kDomain
        << "\n  release: 1.0\n  security: true\n  hosts: { cab: { address: 10.42.1.11 }, coach: { address: 10.42.1.12 "
           "} }\n"
           "  services: { frame_grabber: cab, odometry: cab, fusion: cab, monitor: coach }\n";
    const auto made = tool::make_keys(core::value_or_throw(tool::read_manifest(folder_)), {});
    ASSERT_TRUE(made.ok()) << made.error().message;
  }
  void TearDown() override { fs::remove_all(folder_); }
  [[nodiscard]] std::string keys(const char* host) const { return (folder_ / "security" / host).string(); }
  std::unique_ptr<messaging::Participant> join_in_cab(const std::string& service, bool secured) {
    auto options = TwoHosts::network(TwoHosts::cab, train_, kDomain);
    options.service = service;
    options.host = "cab";
    if (secured) options.security_folder = keys("cab");
    return hosts_.on(TwoHosts::cab, [&] { return std::make_unique<messaging::Participant>(options); });
  }
  /// All that crosses the cable until the coach has heard the secret from the cab.
  std::string heard_on_cable(bool secured) {
    const auto eavesdropper = hosts_.on(TwoHosts::cab, [] { return std::make_unique<Eavesdropper>(); });
    EXPECT_TRUE(eavesdropper->ready());
    std::ofstream(folder_ / "coach.yaml")
        << "common: { train_id: " << train_ << ", domain: " << kDomain << ", host: coach, interfaces: [train1], "
        << "peers: [10.42.1.11]" << (secured ? ", security: " + keys("coach") : "") << " }\n";
    const auto said = folder_ / "said";
    const auto listener = hosts_.on(TwoHosts::coach, [&] {
      return std::make_unique<test::Program>(
          std::vector<std::string>{"railfix", "log", "-f", "--config", (folder_ / "coach.yaml").string()},
          test::Program::Options{said, {}, {}});
    });
    const auto fusion = join_in_cab("fusion", secured);
    messaging::Queue queue;
    messaging::Writer<msg::LogRecord> log(*fusion, topics::log_record);
    msg::LogRecord record;
    record.service("fusion");
    record.text(kSecret);
    EXPECT_TRUE(test::run_until(queue,
                                [&] {
                                  log.write(record);
                                  return test::slurp(said).find(kSecret) != std::string::npos;
                                }))
        << "the coach does not hear the cab: " << test::slurp(said);
    return eavesdropper->heard();
  }
  const std::string train_ = "on-the-wire-" + std::to_string(getpid());
  const fs::path folder_ = fs::temp_directory_path() / train_;
  TwoHosts hosts_;
};

// Names of services and topics can be read: a participant shows its signed permissions before anything is encrypted.
TEST_F(OnTheWire, WhatASecuredTrainSaysCannotBeRead) {
  EXPECT_NE(heard_on_cable(false).find(kSecret), std::string::npos) << "an open train: this test could not fail";
  const auto secured = heard_on_cable(true);
  EXPECT_NE(secured.find("fusion@cab"), std::string::npos) << "its certificate has not gone by: nothing was heard";
  EXPECT_EQ(secured.find(kSecret), std::string::npos);
}

// Encrypted ones would be copied for each reader, and encrypted for each.
TEST_F(OnTheWire, PicturesOfASecuredTrainAreSharedInMemoryAsTheyAre) {
  const auto grabber = join_in_cab("frame_grabber", true);
  const auto odometry = join_in_cab("odometry", true);
  messaging::Queue queue;
  uint64_t pictures = 0;
  messaging::Writer<msg::CameraFrame> writer(*grabber, topics::camera_frame, "cam0");
  messaging::Reader<msg::CameraFrame> reader(*odometry, topics::camera_frame, "cam0", queue,
                                             [&](const msg::CameraFrame&) { ++pictures; });
  const std::string pixels = kSecret;
  ASSERT_TRUE(test::run_until(queue, [&] {
    writer.write_in_place([&](msg::CameraFrame& frame) {
      frame.width_px(64);
      frame.height_px(48);
      std::copy(pixels.begin(), pixels.end(), frame.data().begin());
    });
    return pictures >= 5;
  }));
  std::ifstream maps("/proc/self/maps");
  bool shared = false;
  for (std::string line; std::getline(maps, line);) {
    const size_t at = line.find("/dev/shm/fast_datasharing");
    shared = shared || (at != std::string::npos && test::slurp(line.substr(at)).find(pixels) != std::string::npos);
  }
  EXPECT_TRUE(shared);
}

}  // namespace
}  // namespace railfix::on_the_wire_test
