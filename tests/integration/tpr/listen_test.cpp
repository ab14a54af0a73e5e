// `railfix tpr listen` with a name of its own at a real Mosquitto: what is confirmed there is gone.
#include <gmock/gmock.h>

#include <nlohmann/json.hpp>

#include "integration/tpr/ground_link_fixture.hpp"

namespace railfix {
namespace {

using ::testing::HasSubstr;

constexpr double kListenPatienceS = 20;

class Listen : public GroundLinkTest {
 protected:
  void SetUp() override {
    GroundLinkTest::SetUp();
    if (IsSkipped()) return;
    ASSERT_TRUE(broker_.start());
  }
  [[nodiscard]] std::vector<std::string> command(const std::vector<std::string>& more) const {
    std::vector<std::string> words{"railfix", "tpr", "listen", "--broker", broker_.address(), "--client-id", "rbc"};
    words.insert(words.end(), more.begin(), more.end());
    return words;
  }
  /// The broker keeps what comes for it from now on.
  [[nodiscard]] bool leaves_a_session() const {
    test::Program listen(command({}), {file("out"), file("err"), {}});
    return wait_for([&] { return test::slurp(file("err")) == "connected\n"; }) && listen.end(SIGTERM) == 0;
  }
  /// Numbered from 1; until the broker has confirmed all, or that nobody has subscribed.
  [[nodiscard]] bool train_sends(uint64_t reports) {
    std::atomic<bool> connected = false;
    std::atomic<uint64_t> confirmed = 0;
    unheard_ = 0;
    ground_link::MqttOptions options;
    core::ok_or_throw(ground_link::parse_broker(broker_.address(), options));
    ground_link::MqttEvents events;
    events.connected = [&](auto) { connected = true; };
    events.delivered = [&](int) { ++confirmed; };
    events.unheard = [&](int) { ++unheard_; };
    ground_link::MqttClient train(options, events);
    if (!wait_for([&] { return connected.load(); })) return false;
    for (uint64_t i = 1; i <= reports; ++i) {
      auto sent = report(i);
      sent.sequence = i;
      if (!train.publish("railfix/" + train_ + "/position_report", ground_link::to_bytes(sent)).ok()) return false;
    }
    return wait_for([&] { return confirmed + unheard_ == reports; });
  }
  /// What one that ends after so many prints.
  [[nodiscard]] std::vector<uint64_t> heard(uint64_t count) const {
    const auto outcome = test::run_program(command({"--json", "--count", std::to_string(count)}), kListenPatienceS);
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
    std::vector<uint64_t> numbers;
    std::istringstream lines(outcome.out);
    for (std::string line; std::getline(lines, line);)
      numbers.push_back(nlohmann::json::parse(line)["sequence"].get<uint64_t>());
    return numbers;
  }
  test::Broker broker_{file("broker")};
  std::atomic<uint64_t> unheard_ = 0;
};

TEST_F(Listen, WhatComesBehindTheLastOneThatIsWantedStaysAtTheBroker) {
  ASSERT_TRUE(leaves_a_session());
  ASSERT_TRUE(train_sends(60));
  for (uint64_t first = 1; first < 60; first += 20) {
    const auto numbers = heard(20);
    ASSERT_EQ(numbers.size(), 20U);
    for (uint64_t i = 0; i < 20; ++i) EXPECT_EQ(numbers[i], first + i);
  }
}

TEST_F(Listen, WhatCannotBeWrittenStaysAtTheBroker) {
  ASSERT_TRUE(leaves_a_session());
  ASSERT_TRUE(train_sends(40));
  test::Program full(command({"--json"}), {"/dev/full", file("err"), {}});
  ASSERT_TRUE(wait_for([&] { return full.exit_code().has_value(); }));
  EXPECT_EQ(full.exit_code(), 1);
  EXPECT_THAT(test::slurp(file("err")), HasSubstr("cannot write to standard output (No space left on device)"));
  const auto numbers = heard(40);
  ASSERT_EQ(numbers.size(), 40U);
  for (uint64_t i = 0; i < 40; ++i) EXPECT_EQ(numbers[i], i + 1);
}

TEST_F(Listen, ASessionThatIsForgottenTakesNothing) {
  ASSERT_TRUE(leaves_a_session());
  ASSERT_TRUE(train_sends(1));
  EXPECT_EQ(unheard_, 0U);
  const auto outcome = test::run_program(command({"--forget"}), kListenPatienceS);
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(
      outcome.out,
      HasSubstr("the broker keeps nothing for rbc any more; a listener that runs under this name begins it anew"));
  ASSERT_TRUE(train_sends(1));
  EXPECT_EQ(unheard_, 1U);
}

TEST_F(Listen, AnAddressOfIpv6IsNamedAsItWasGiven) {
  const auto there = "[::1]:" + std::to_string(test::free_port());
  test::Program listen({"railfix", "tpr", "listen", "--broker", there}, {file("out"), file("err"), {}});
  ASSERT_TRUE(wait_for([&] { return test::slurp(file("err")).ends_with("\n"); }));
  EXPECT_TRUE(test::slurp(file("err")).starts_with("not connected to " + there + " (")) << test::slurp(file("err"));
}

TEST_F(Listen, ATrainThatIsSilentIsNamed) {
  test::Program listen(command({"--silent-after-s", "1.5"}), {file("out"), file("err"), {}});
  const auto said = [&] { return test::slurp(file("err")); };
  ASSERT_TRUE(wait_for([&] { return said() == "connected\n"; }));
  ASSERT_TRUE(train_sends(1));
  ASSERT_TRUE(wait_for([&] { return std::ranges::count(said(), '\n') == 2; }));
  EXPECT_EQ(said(), "connected\n" + train_ + " has been silent for 1.5 s\n");
}

}  // namespace
}  // namespace railfix
