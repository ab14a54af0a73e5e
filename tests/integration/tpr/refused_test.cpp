// Brokers that refuse reports, and one that has no words for it.
#include <sys/resource.h>

#include <csignal>
#include <future>

#include "integration/tpr/ground_link_fixture.hpp"
#include "integration/tpr/old_broker.hpp"

namespace railfix {
namespace {

using ::testing::HasSubstr;

class RefusedReports : public GroundLinkTest {
 protected:
  /// Its list of rights lets everybody without a name read and write, the train's user only read.
  RefusedReports() { may_write(false); }
  void may_write(bool may) const {
    std::ofstream(file("acl")) << "topic readwrite railfix/#\nuser " << train_ << "\ntopic "
                               << (may ? "readwrite" : "read") << " railfix/" << train_ << "/#\n";
  }
  [[nodiscard]] tpr_publisher::GroundLinkSettings users_link() const {
    auto settings = link_settings(broker_.address());
    settings.mqtt.user = train_;
    return settings;
  }
  [[nodiscard]] std::string topic() const { return "railfix/" + train_ + "/position_report"; }
  test::Broker broker_{file("broker"), "acl_file " + file("acl").string() + "\n"};
};

TEST_F(RefusedReports, WaitInTheStoreUntilTheListOfRightsIsMended) {
  ASSERT_TRUE(broker_.start());
  Ground ground(broker_.address(), train_);
  ASSERT_TRUE(ground.subscribed());
  const auto command = linked_service(broker_.address(), {"tpr_publisher.ground_link.user=" + train_});
  const auto each = [&] { write_state(last_.offset_m); };
  {
    test::Program program(command);
    ASSERT_TRUE(run_until([&] { return connected(); }, [] {}));
    ASSERT_TRUE(run_for(3));
    ASSERT_TRUE(status_says("refuses what user " + train_ + " writes to " + topic()));
    ASSERT_TRUE(status_says("3 reports wait"));
    EXPECT_THAT(reason(), HasSubstr("let it write there in the broker's list of rights (acl_file)"));
    EXPECT_EQ(status_->state(), msg::STATE_DEGRADED);
    program.end(SIGKILL);
  }
  ASSERT_TRUE(run_until([&] { return states_.matched_readers() == 0; }, [] {}));
  test::Program program(command);
  ASSERT_TRUE(run_until([&] { return connected() && states_.matched_readers() > 0; }, [] {}));
  ASSERT_TRUE(run_for(6));
  ASSERT_TRUE(status_says("6 reports wait"));
  EXPECT_EQ(ground.count(), 0U);
  may_write(true);
  broker_.reload();
  ASSERT_TRUE(run_until([&] { return ground.count() >= 6; }, each)) << reason();
  ASSERT_TRUE(run_until([&] { return status_->state() == msg::STATE_ACTIVE; }, each)) << reason();
  const auto arrived = ground.reports();
  for (size_t i = 0; i < 6; ++i) {
    EXPECT_EQ(arrived[i].sequence, i % 3 + 1) << "numbered by each start anew";
    EXPECT_EQ(arrived[i].stamp_ns, reports_[i].stamp_ns());
  }
}

TEST_F(GroundLinkTest, ReportsWaitUntilSomebodyOnTheGroundListens) {
  test::Broker broker(file("broker"));
  ASSERT_TRUE(broker.start());
  test::Program program(linked_service(broker.address(), {}));
  ASSERT_TRUE(run_until([&] { return connected() && states_.matched_readers() > 0; }, [] {}));
  ASSERT_TRUE(run_for(3));
  ASSERT_TRUE(status_says("nobody on the ground has subscribed to railfix/" + train_ + "/position_report"));
  ASSERT_TRUE(status_says("3 reports wait"));
  EXPECT_EQ(status_->state(), msg::STATE_DEGRADED);
  Ground ground(broker.address(), train_);
  ASSERT_TRUE(ground.subscribed());
  const auto each = [&] { write_state(last_.offset_m); };
  ASSERT_TRUE(run_until([&] { return ground.count() >= 3; }, each)) << reason();
  ASSERT_TRUE(run_until([&] { return status_->state() == msg::STATE_ACTIVE; }, each)) << reason();
  EXPECT_EQ(ground.missing(), 0U);
  EXPECT_EQ(ground.reports()[0].sequence, 1U);
}

TEST_F(RefusedReports, ArriveInOrderHoweverOftenTheListChanges) {
  constexpr size_t kAtOnce = 100;
  may_write(true);
  ASSERT_TRUE(broker_.start());
  Ground ground(broker_.address(), train_);
  ASSERT_TRUE(ground.subscribed());
  tpr_publisher::GroundLink link(users_link());
  uint64_t made = 0;
  for (int round = 0; round < 3; ++round) {
    may_write(false);
    broker_.reload();
    // The broker reads its list a little later: until then it takes reports.
    ASSERT_TRUE(wait_for([&] {
      link.send(report(++made));
      return link.trouble().find("refuses") != std::string::npos;
    }));
    EXPECT_FALSE(link.connected());
    for (size_t i = 0; i < kAtOnce; ++i) link.send(report(++made));
    EXPECT_LT(ground.count(), made);
    may_write(true);
    broker_.reload();
    ASSERT_TRUE(wait_for([&] { return ground.count() == made; })) << link.trouble();
    ASSERT_TRUE(wait_for([&] { return link.trouble().empty(); })) << link.trouble();
  }
  EXPECT_EQ(ground.twice(), 0U);
  const auto arrived = ground.reports();
  for (size_t i = 0; i < arrived.size(); ++i) ASSERT_EQ(arrived[i].sequence, i + 1);
}

// A limit on files stands for a full disk.
TEST_F(RefusedReports, ThatCouldNotBeStoredKeepTheirNumbers) {
  ASSERT_TRUE(broker_.start());
  Ground ground(broker_.address(), train_);
  ASSERT_TRUE(ground.subscribed());
  tpr_publisher::GroundLink link(users_link());
  const auto usual = std::signal(SIGXFSZ, SIG_IGN);
  rlimit before{};
  ASSERT_EQ(getrlimit(RLIMIT_FSIZE, &before), 0);
  const rlimit full{1024, before.rlim_max};
  may_write(false);
  ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &full), 0);
  for (uint64_t i = 1; i <= 5; ++i) link.send(report(i));
  const bool refused = wait_for([&] {
    const auto trouble = link.trouble();
    return trouble.find("refuses") != std::string::npos && trouble.find("5 reports wait") != std::string::npos;
  });
  ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &before), 0);
  may_write(true);
  ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &full), 0);
  broker_.reload();
  const bool arrived = wait_for([&] { return ground.count() >= 5; });
  ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &before), 0);
  std::signal(SIGXFSZ, usual);
  EXPECT_TRUE(refused && arrived) << link.trouble();
  const auto reports = ground.reports();
  for (size_t i = 0; i < reports.size(); ++i) {
    EXPECT_EQ(reports[i].sequence, i + 1);
    EXPECT_EQ(reports[i].stamp_ns, static_cast<int64_t>(i + 1));
  }
}

TEST_F(RefusedReports, AreNotSeenByABrokerThatKnowsOnlyMqtt311AndThatIsSaid) {
  may_write(true);
  ASSERT_TRUE(broker_.start());
  Ground ground(broker_.address(), train_);
  ASSERT_TRUE(ground.subscribed());
  const test::OldBroker old(broker_.port());
  auto settings = users_link();
  core::ok_or_throw(ground_link::parse_broker(old.address(), settings.mqtt));
  tpr_publisher::GroundLink link(settings);
  for (uint64_t i = 1; i <= 50; ++i) link.send(report(i));
  ASSERT_TRUE(wait_for([&] { return ground.count() >= 50; })) << link.trouble();
  EXPECT_THAT(link.remark(), HasSubstr("the broker " + old.address() + " knows only MQTT 3.1.1"));
  EXPECT_TRUE(link.connected());
  EXPECT_GE(old.refused(), 1);
  const auto arrived = ground.reports();
  for (size_t i = 0; i < 50; ++i) EXPECT_EQ(arrived[i].sequence, i + 1);
}

// Mosquitto's list of rights (acl_file) refuses no subscription, its dynamic security does.
class RefusedSubscription : public GroundLinkTest {
 protected:
  void SetUp() override {
    GroundLinkTest::SetUp();
    if (!std::filesystem::exists(kPlugin)) GTEST_SKIP() << kPlugin << " is not installed";
  }
  void may_subscribe(bool may) const {
    std::ofstream(file("security.json")) << R"({"defaultACLAccess": {"publishClientSend": true, )"
                                         << R"("publishClientReceive": true, "unsubscribe": true, "subscribe": )"
                                         << (may ? "true" : "false") << "}}";
  }
  static constexpr const char* kPlugin = "/usr/lib/x86_64-linux-gnu/mosquitto_dynamic_security.so";
  test::Broker broker_{file("broker"), std::string("plugin ") + kPlugin + "\nplugin_opt_config_file " +
                                           file("security.json").string() + "\n"};
};

TEST_F(RefusedSubscription, IsSaidAndTriedAgainUntilItIsGranted) {
  for (const bool keep_session : {false, true}) {  // MQTT 5 and 3.1.1
    may_subscribe(false);
    ASSERT_TRUE(broker_.start());
    std::atomic<int> connected = 0;
    std::atomic<int> disconnected = 0;
    std::promise<std::string> why;  // at first
    auto options = link_settings(broker_.address()).mqtt;
    options.keep_session = keep_session;
    options.subscribe_to = "railfix/+/position_report";
    const ground_link::MqttClient client(options, {[&](auto) { ++connected; },
                                                   [&](const std::string& said) {
                                                     if (++disconnected == 1) why.set_value(said);
                                                   },
                                                   {},
                                                   {},
                                                   {}});
    ASSERT_TRUE(wait_for([&] { return disconnected >= 3; })) << connected;
    EXPECT_EQ(connected, 0);
    EXPECT_EQ(why.get_future().get(), "it refuses the subscription to \"railfix/+/position_report\": " +
                                          std::string(keep_session ? "Unspecified error" : "Not authorized"));
    broker_.stop();
    may_subscribe(true);
    ASSERT_TRUE(broker_.start());
    EXPECT_TRUE(wait_for([&] { return connected == 1; }));
    broker_.stop();
  }
}

}  // namespace
}  // namespace railfix
