// What every service program does alike: documents and checks its configuration, gets ready, ends cleanly on SIGTERM.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "core/time.hpp"
#include "messaging/topics.hpp"
#include "service/service.hpp"
#include "support/network.hpp"
#include "support/program.hpp"

namespace railfix {
namespace {

using ::testing::HasSubstr;
namespace fs = std::filesystem;

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

TEST_P(EveryService, GetsReadyAndEndsCleanlyOnSigterm) {
  const std::string train = "services-test-" + GetParam() + "-" + std::to_string(getpid());
  const auto folder = fs::temp_directory_path() / train;
  write_dataset(folder);
  test::Program service(test::with_settings(program(), {"common.train_id=" + train, "common.domain=78",
                                                        "frame_grabber.source=.", "sensor_gateway.source=."}),
                        {{}, {}, folder});
  messaging::Participant participant(test::network(train, 78));
  messaging::Queue queue;
  bool stopped = false;
  bool up = false;
  messaging::Reader<msg::ServiceStatus> reader(participant, messaging::topics::service_status, "", queue,
                                               [&](const msg::ServiceStatus& status) {
                                                 if (status.state() == msg::STATE_STOPPED) stopped = true;
                                                 if (status.state() != msg::STATE_STARTING && !up) {
                                                   up = true;
                                                   EXPECT_EQ(std::string(status.service().c_str()), GetParam());
                                                   service.send(SIGTERM);
                                                 }
                                               });
  const int64_t deadline_ns = core::monotonic_ns() + 60 * core::kNsPerSecond;
  while (!service.exit_code() && core::monotonic_ns() < deadline_ns) {
    queue.run_one(core::monotonic_ns() + core::kNsPerSecond / 20);
  }
  while (queue.run_one(0)) {
  }
  EXPECT_TRUE(up) << "never got ready";
  EXPECT_TRUE(stopped) << "did not say that it stops";
  EXPECT_EQ(service.exit_code(), 0) << "did not end on SIGTERM, or not cleanly";
  fs::remove_all(folder);
}

INSTANTIATE_TEST_SUITE_P(Railfix, EveryService, ::testing::ValuesIn(service::service_names()),
                         [](const auto& name) { return name.param; });

}  // namespace
}  // namespace railfix
