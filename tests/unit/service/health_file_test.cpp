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
  EXPECT_EQ(ask_health(path).text, "active: as it should be (no input yet, no output yet)");
  EXPECT_EQ(ask_health(path).serves, "");
  EXPECT_FALSE(ask_health(path).input_s);
  now->write(status, {}, "http://127.0.0.1:8081/");
  EXPECT_EQ(ask_health(path).serves, "http://127.0.0.1:8081/");
  now.reset();
  EXPECT_FALSE(std::filesystem::exists(path));
}

// It has taken the place of the one before; the next one has its name by now.
TEST(HealthFile, OneThatWasRenamedLeavesItsSuccessorsAlone) {
  const auto beside = std::filesystem::temp_directory_path() / ("railfix-health-beside-" + std::to_string(getpid()));
  msg::ServiceStatus status;
  status.state(msg::STATE_ACTIVE);
  std::optional<HealthFile> before(beside);
  before->write(status);
  const std::filesystem::path place = beside.string() + "-place";
  std::filesystem::rename(beside, place);
  HealthFile now(beside);
  now.write(status);
  before.reset();
  EXPECT_TRUE(ask_health(beside).healthy);
  std::filesystem::remove(place);
}

class HealthFileFlow : public ::testing::Test {
 protected:
  /// Asked again where this computer was held up: the answer says tenths of a second.
  HealthAnswer ask(Flow flow, double input_since_s, double last_input_s, double last_output_s, bool stands_by = false) {
    HealthAnswer answer;
    int64_t began_ns = 0;
    do {
      began_ns = core::monotonic_ns();
      answer = ask_at(began_ns, flow, input_since_s, last_input_s, last_output_s, stands_by);
    } while (core::monotonic_ns() - began_ns > 40'000'000);
    return answer;
  }
  HealthAnswer ask_at(int64_t now_ns, Flow flow, double input_since_s, double last_input_s, double last_output_s,
                      bool stands_by) {
    const auto at = [&](double ago_s) { return ago_s < 0 ? 0 : now_ns - core::to_ns(ago_s); };
    msg::ServiceStatus status;
    status.state(msg::STATE_DEGRADED);
    HealthFile file(path_);
    file.write(status, {flow, stands_by, at(input_since_s), at(last_input_s), at(last_output_s)});
    return ask_health(path_);
  }
  const std::filesystem::path path_ =
      std::filesystem::temp_directory_path() / ("railfix-health-flow-" + std::to_string(getpid()));
};

TEST_F(HealthFileFlow, OneThatAnswersNothingIsStuck) {
  const auto answer = ask(Flow::answers, 10, 0.1, 5);
  EXPECT_NEAR(answer.input_s.value(), 0.1, 0.05);
  EXPECT_TRUE(answer.stuck);
  EXPECT_TRUE(answer.healthy) << "its supervisor leaves it alone";
  EXPECT_FALSE(answer.works()) << "an operator is told";
  EXPECT_EQ(answer.text, "input comes, nothing goes out: degraded (last input 0.1 s ago, last output 5.0 s ago)");
  EXPECT_TRUE(ask(Flow::answers, 10, 0.1, -1).stuck);
  EXPECT_FALSE(ask(Flow::answers, 10, 0.1, 0.1).stuck);
  EXPECT_FALSE(ask(Flow::answers, 1, 0.1, -1).stuck) << "input has only begun";
  EXPECT_FALSE(ask(Flow::answers, 60, 10, 10).stuck) << "no input, no output";
  EXPECT_FALSE(ask(Flow::answers, 10, 0.1, 5, true).stuck) << "another one sends";
  EXPECT_FALSE(ask(Flow::steady, 10, 0.1, 5).stuck) << "it may wait for another input";
}

TEST_F(HealthFileFlow, WhoSendsSteadilyIsTold) {
  EXPECT_TRUE(ask(Flow::steady, 10, 0.1, 0.1).sends);
  EXPECT_TRUE(ask(Flow::answers, 10, 0.1, 0.1).sends);
  EXPECT_FALSE(ask(Flow::steady, 10, 0.1, 3).sends);
  EXPECT_FALSE(ask(Flow::sporadic, 10, 0.1, 0.1).sends);
}

}  // namespace
}  // namespace railfix::service
