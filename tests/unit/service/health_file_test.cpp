#include "service/health_file.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <optional>

namespace railfix::service {
namespace {

TEST(HealthFile, StandsThereAgainWhenTheBuildBeforeTakesItAway) {
  const auto path = std::filesystem::temp_directory_path() / ("railfix-health-test-" + std::to_string(getpid()));
  msg::ServiceStatus status;
  status.state(msg::STATE_ACTIVE);
  std::optional<HealthFile> before(path);
  before->write(status);
  std::optional<HealthFile> now(path);
  before.reset();
  EXPECT_FALSE(ask_health(path).healthy);
  now->write(status);
  EXPECT_TRUE(ask_health(path).healthy);
  now.reset();
  EXPECT_FALSE(std::filesystem::exists(path));
}

}  // namespace
}  // namespace railfix::service
