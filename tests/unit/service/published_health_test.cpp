// What a service says of itself, to its train and to who watches it on its computer.
#include <gmock/gmock.h>
#include <spdlog/sinks/null_sink.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <thread>

#include "core/time.hpp"
#include "service/health.hpp"
#include "support/held_discovery.hpp"

namespace railfix::service {
namespace {

// The loop turns and says that all is well, but nobody will ever be discovered again.
TEST(PublishedHealthTest, WhoseDiscoveryIsStuckFallsSilent) {
  CommonConfig common;
  common.train_id = "deaf-" + std::to_string(getpid());
  common.host = "cab";
  messaging::ParticipantOptions options;
  options.train_id = common.train_id;
  options.domain = 77;
  messaging::Participant participant(options);
  spdlog::logger log("none", std::make_shared<spdlog::sinks::null_sink_mt>());
  PublishedHealth health(participant, "fusion", common, false, log);
  const auto file = health_path(common, "fusion");
  const auto is_silent_within_s = [&](double seconds) {
    for (const int64_t until_ns = core::monotonic_ns() + core::to_ns(seconds); core::monotonic_ns() < until_ns;) {
      health.beat();
      health.publish();
      if (core::seconds(silent_ns(file).value_or(0)) > 2) return true;
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
    }
    return false;
  };
  EXPECT_FALSE(is_silent_within_s(0.2));
  {
    const test::HeldDiscovery held(participant);
    EXPECT_TRUE(is_silent_within_s(60));  // after five seconds in which this process was not held up itself
  }
  health.beat();
  EXPECT_LT(core::seconds(silent_ns(file).value()), 1);
}

}  // namespace
}  // namespace railfix::service
