// What every service program does alike: documents and checks its configuration, gets ready, ends cleanly on SIGTERM,
// and needs no other rights than those of its own certificate.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "core/time.hpp"
#include "messaging/topics.hpp"
#include "service/service.hpp"
#include "support/network.hpp"
#include "support/program.hpp"
#include "train/keys.hpp"

namespace railfix {
namespace {

using ::testing::HasSubstr;
namespace fs = std::filesystem;

constexpr int64_t kDomain = 78;

class EveryService : public ::testing::TestWithParam<std::string> {
 protected:
  [[nodiscard]] static std::string program() {
    std::string name = "railfix-" + GetParam();
    std::replace(name.begin(), name.end(), '_', '-');
    return name;
  }
};

// The smallest dataset that the two services with a source of their own can open.
void write_dataset(const fs::path& folder) {
  fs::create_directories(folder / "mav0" / "cam0" / "data");
  fs::create_directories(folder / "mav0" / "wheel0");
  std::ofstream(folder / "mav0" / "cam0" / "data" / "1.pgm") << "P5 64 48 255\n" << std::string(64 * 48, 'x');
  std::ofstream(folder / "mav0" / "cam0" / "data.csv") << "#timestamp [ns],filename\n1,1.pgm\n";
  std::ofstream(folder / "mav0" / "cam0" / "sensor.yaml")
      << "rate_hz: 30\nresolution: [64, 48]\ncamera_model: pinhole\nintrinsics: [60, 60, 32, 24]\n"
         "distortion_model: radial-tangential\ndistortion_coefficients: [0, 0, 0, 0]\n";
  std::ofstream(folder / "mav0" / "wheel0" / "data.csv") << "#timestamp [ns],pulses\n1,0\n";
  std::ofstream(folder / "mav0" / "wheel0" / "sensor.yaml") << "pulses_per_metre: 40\n";
}

TEST_P(EveryService, DefaultConfigurationFileIsItsDocumentation) {
  const auto documented = test::run_program({program(), "--document"}, 10);
  EXPECT_EQ(documented.exit_code, 0);
  const auto file = fs::path(RAILFIX_SOURCE_DIR) / "services" / GetParam() / (GetParam() + ".yaml");
  EXPECT_EQ(test::slurp(file), documented.out) << "write it anew: " << program() << " --document > " << file;
  EXPECT_EQ(test::run_program({program(), "--check", "--config", file.string()}, 10).exit_code, 0);
}

TEST_P(EveryService, RefusesAnUnknownKeyByNameAndFile) {
  const auto file =
      fs::path(::testing::TempDir()) / ("railfix-" + GetParam() + "-" + std::to_string(getpid()) + ".yaml");
  std::ofstream(file) << GetParam() << ":\n  no_such_key: 1\n";
  const auto refused = test::run_program({program(), "--check", "--config", file.string()}, 10);
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_THAT(refused.err, HasSubstr(file.string() + " line 2: " + GetParam() + ".no_such_key is not a key"));
  fs::remove(file);
}

/// `keys`: of the train's only host; empty without certificates.
void expect_ready_and_clean_end(const std::string& name, const std::string& program, const fs::path& folder,
                                const std::string& keys) {
  const std::string train = folder.filename();
  write_dataset(folder);
  std::vector<std::string> settings{"common.train_id=" + train, "common.domain=" + std::to_string(kDomain),
                                    "common.host=cab", "frame_grabber.source=.", "sensor_gateway.source=."};
  if (!keys.empty()) settings.push_back("common.security=" + keys);
  test::Program service(test::with_settings(program, settings), {{}, {}, folder});
  auto network = test::network(train, kDomain);
  network.service = "railfix-test";
  network.security_folder = keys;
  messaging::Participant participant(network);
  messaging::Queue queue;
  bool stopped = false;
  bool up = false;
  messaging::Reader<msg::ServiceStatus> reader(participant, messaging::topics::service_status, "", queue,
                                               [&](const msg::ServiceStatus& status) {
                                                 if (status.state() == msg::STATE_STOPPED) stopped = true;
                                                 if (status.state() != msg::STATE_STARTING && !up) {
                                                   up = true;
                                                   EXPECT_EQ(std::string(status.service().c_str()), name);
                                                   service.send(SIGTERM);
                                                 }
                                               });
  const int64_t deadline_ns = core::monotonic_ns() + 60 * core::kNsPerSecond;
  while (!(service.exit_code() && stopped) && core::monotonic_ns() < deadline_ns) {
    queue.run_one(core::monotonic_ns() + core::kNsPerSecond / 20);
  }
  EXPECT_TRUE(up) << "never got ready";
  EXPECT_TRUE(stopped) << "did not say that it stops";
  EXPECT_EQ(service.exit_code(), 0) << "did not end on SIGTERM, or not cleanly";
}

// Fast DDS would be ended by a signal where it writes the first picture.
TEST(SharedMemory, AFrameGrabberWithoutRoomForPicturesSaysSo) {
  const auto folder = fs::temp_directory_path() / ("services-test-full-" + std::to_string(getpid()));
  write_dataset(folder);
  for (const char* size : {"20m", "1"}) {  // for its files, but not for pictures; for nothing
    const std::string command =
        std::string("mount -t tmpfs -o size=") + size + " none /dev/shm || exit 77; exec " + RAILFIX_BIN_DIR +
        "/railfix-frame-grabber --set frame_grabber.source=" + folder.string() +
        " --set common.domain=" + std::to_string(kDomain) + " --set common.train_id=" + folder.filename().string();
    const auto refused = test::run_program({"/usr/bin/unshare", "--mount", "/bin/sh", "-c", command}, 60);
    if (refused.exit_code == 77 || refused.err.find("unshare:") != std::string::npos) {
      fs::remove_all(folder);
      GTEST_SKIP() << "skipped: this user may not mount";
    }
    EXPECT_EQ(refused.exit_code, 1) << size << refused.out << refused.err;
    EXPECT_THAT(refused.out + refused.err,
                HasSubstr("topic camera_frame/cam0 needs 40 MB of shared memory: make room in /dev/shm"));
  }
  fs::remove_all(folder);
}

TEST_P(EveryService, GetsReadyAndEndsCleanlyOnSigterm) {
  const auto folder = fs::temp_directory_path() / ("services-test-" + GetParam() + "-" + std::to_string(getpid()));
  expect_ready_and_clean_end(GetParam(), program(), folder, "");
  fs::remove_all(folder);
}

// A topic that it reads or writes and has no right to would end it at the start, on secured trains only.
TEST_P(EveryService, GetsReadyWithNoOtherRightsThanItsOwn) {
  const auto folder = fs::temp_directory_path() / ("services-locked-" + GetParam() + "-" + std::to_string(getpid()));
  fs::create_directories(folder);
  std::ofstream(folder / "train.yaml") << "train:\n  id: " << folder.filename().string() << "\n  domain: " << kDomain
                                       << "\n  release: 1.0\n  security: true\n"
                                       << "  hosts: { cab: { address: 127.0.0.1 } }\n  services: { " << GetParam()
                                       << ": cab }\n";
  const auto made = tool::make_keys(core::value_or_throw(tool::read_manifest(folder)), {});
  ASSERT_TRUE(made.ok()) << made.error().message;
  expect_ready_and_clean_end(GetParam(), program(), folder, (folder / "security/cab").string());
  fs::remove_all(folder);
}

TEST(Services, KeysThatCannotWorkTogetherAreRefused) {
  const auto refused = [](const std::string& setting) {
    const auto checked = test::run_program(
        {"railfix-map-matcher", "--check", "--set", setting, "--set", "map_matcher.locator.least_way_m=3000"}, 10);
    return checked.exit_code == 2 ? checked.err : "accepted";
  };
  EXPECT_THAT(refused("map_matcher.locator.window_m=2000"), HasSubstr("window_m is less than least_way_m"));
  EXPECT_THAT(refused("map_matcher.track.view_from_m=25"), HasSubstr("view_from_m must be less than view_to_m"));
}

TEST(Services, SensorsOfAFolderThatIsMissingAreRefused) {
  const auto refused = test::run_program({"railfix-sensor-gateway", "--set", "common.domain=" + std::to_string(kDomain),
                                          "--set", "sensor_gateway.source=recordings/misspelt"},
                                         20);
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_THAT(refused.err, HasSubstr("sensor_gateway.source: recordings/misspelt does not exist; give a dataset"));
}

INSTANTIATE_TEST_SUITE_P(Railfix, EveryService, ::testing::ValuesIn(service::service_names()),
                         [](const auto& name) { return name.param; });

}  // namespace
}  // namespace railfix
