#include "service/health_file.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <optional>

#include "core/time.hpp"

namespace railfix::service {
namespace {

TEST(HealthFile, StandsThereAgainWhenTheBuildBeforeTakesItAway) {
  const auto path = std::filesystem::temp_directory_path() / ("railfix-health-test-" + std::to_string(getpid()));
  msg::ServiceStatus status;
  status.state(msg::STATE_ACTIVE);
  status.reason("as it should be");
  std::optional<HealthFile> before(path);
  before->write(status);
  std::optional<HealthFile> now(path);
  before.reset();
  EXPECT_FALSE(ask_health(path).healthy);
  now->write(status);
  EXPECT_TRUE(ask_health(path).healthy);
  const auto asked_ns = core::monotonic_ns();
  now->beat();
  const auto silent = silent_ns(path);
  EXPECT_LE(silent, core::monotonic_ns() - asked_ns);
  EXPECT_EQ(ask_health(path).text, "active: as it should be");
  now.reset();
  EXPECT_FALSE(std::filesystem::exists(path));
}

}  // namespace
}  // namespace railfix::service
