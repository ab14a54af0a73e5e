// Brokers that keep a connection and do not do their work over it, and those that keep none.
#include <sys/syscall.h>

#include <atomic>

#include "integration/tpr/false_broker.hpp"
#include "integration/tpr/ground_link_fixture.hpp"

namespace {

std::atomic<bool> disk_waits = false;
std::atomic<int> waiting_for_the_disk = 0;

int synchronised(long call, int file) {
  ++waiting_for_the_disk;
  while (disk_waits) poll(nullptr, 0, 10);
  --waiting_for_the_disk;
  return static_cast<int>(syscall(call, file));
}

}  // namespace

// A slow disk: the calls by which SQLite makes sure that a report is on it.
extern "C" int fdatasync(int file) {
  return synchronised(SYS_fdatasync, file);
}
extern "C" int fsync(int file) {
  return synchronised(SYS_fsync, file);
}

namespace railfix {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

/// Declared behind a link, whose end would wait for the disk.
struct DiskGoesOn {
  ~DiskGoesOn() { disk_waits = false; }
};

class BadBroker : public GroundLinkTest {
 protected:
  void SetUp() override {}  // needs no Mosquitto
  [[nodiscard]] tpr_publisher::GroundLinkSettings bad_link() const {
    auto settings = link_settings(broker_.address());
    settings.mqtt.keep_alive_s = 5;
    return settings;
  }
  static bool comes_to_say(const tpr_publisher::GroundLink& link, const std::string& text) {
    return wait_for([&] { return says(link, text); });
  }
  [[nodiscard]] std::vector<int64_t> stamps(int connection) const {
    std::vector<int64_t> stamps;
    for (const auto& came : broker_.came()) {
      if (came.connection == connection) stamps.push_back(came.stamp_ns);
    }
    return stamps;
  }
  test::FalseBroker broker_;
};

TEST_F(BadBroker, ThatConfirmsNothingIsToldAndTheConnectionIsMadeAnewUntilItDoes) {
  broker_.confirms = false;
  tpr_publisher::GroundLink link(bad_link());
  for (uint64_t i = 1; i <= 3; ++i) link.send(report(i));
  ASSERT_TRUE(wait_for([&] { return stamps(2).size() == 1; })) << link.trouble();
  EXPECT_FALSE(link.connected()) << "let in again, and no better";
  ASSERT_TRUE(comes_to_say(link, "Ground link: the broker " + broker_.address() + " has confirmed nothing for "));
  EXPECT_THAT(link.trouble(), HasSubstr("3 reports wait"));
  EXPECT_FALSE(link.connected());
  broker_.confirms = true;
  ASSERT_TRUE(wait_for([&] { return link.connected() && link.trouble().empty(); })) << link.trouble();
  EXPECT_THAT(stamps(1), ::testing::ElementsAre(1));
  EXPECT_THAT(stamps(2), ::testing::ElementsAre(1));
  EXPECT_THAT(stamps(3), ::testing::ElementsAre(1, 2, 3));
}

TEST_F(BadBroker, WhatItDidNotConfirmFromMemoryIsStoredAtTheEnd) {
  broker_.confirms = false;
  auto settings = bad_link();
  settings.store = file("disk") / "link.db";
  settings.read_patience = {};
  {
    tpr_publisher::GroundLink link(settings);
    link.send(report(1));
    link.send(report(2));
    ASSERT_TRUE(wait_for([&] { return stamps(1).size() == 1; })) << link.trouble();
    std::filesystem::create_directories(file("disk"));
    ASSERT_TRUE(comes_to_say(link, "The store works again; 1 reports of before")) << link.trouble();
  }
  broker_.confirms = true;
  const tpr_publisher::GroundLink again(settings);
  ASSERT_TRUE(wait_for([&] { return stamps(2).size() == 2; })) << again.trouble();
  EXPECT_THAT(stamps(2), ::testing::UnorderedElementsAre(1, 2));
}

TEST_F(BadBroker, NothingOvertakesWhatWasUnderWayWhenItsConnectionBreaksBehindASlowDisk) {
  tpr_publisher::GroundLink link(bad_link());
  const DiskGoesOn at_the_end;
  link.send(report(1));
  ASSERT_TRUE(wait_for([&] { return link.connected() && link.trouble().empty() && stamps(1).size() == 1; }));
  broker_.confirms = false;
  link.send(report(2));
  link.send(report(3));
  ASSERT_TRUE(wait_for([&] { return stamps(1).size() == 3; }));
  disk_waits = true;
  link.send(report(4));
  ASSERT_TRUE(wait_for([&] { return waiting_for_the_disk > 0; }));
  broker_.confirms = true;
  broker_.cut();
  ASSERT_TRUE(wait_for([&] { return broker_.connections() == 2 && broker_.pings() > 0; }));
  disk_waits = false;
  ASSERT_TRUE(wait_for([&] { return stamps(2).size() >= 3; })) << link.trouble();
  EXPECT_THAT(stamps(2), ::testing::ElementsAre(2, 3, 4));
  EXPECT_TRUE(wait_for([&] { return link.trouble().empty(); })) << link.trouble();
}

TEST_F(BadBroker, ThatThrowsOutWhomItHasLetInIsAskedLessOftenAndTold) {
  broker_.throws_out = true;
  auto settings = bad_link();
  settings.mqtt.longest_retry_s = 1;
  settings.mqtt.lasting = std::chrono::seconds(5);
  const auto begun = std::chrono::steady_clock::now();
  const tpr_publisher::GroundLink link(settings);
  const std::string doubt = "in a row soon after it began: is another client called railfix-" + train_ + "?";
  ASSERT_TRUE(wait_for([&] { return broker_.connections() >= 6; })) << link.trouble();
  EXPECT_GE(std::chrono::steady_clock::now() - begun, std::chrono::milliseconds(2500)) << "0.1 + 0.2 + 0.4 + 0.8 + 1";
  EXPECT_TRUE(comes_to_say(link, doubt)) << link.trouble();
  EXPECT_THAT(link.trouble(), HasSubstr("0 reports wait"));
  broker_.throws_out = false;
  ASSERT_TRUE(
      comes_to_say(link, "Ground link: connected to " + broker_.address() + " again, but the connection has ended "))
      << link.trouble();
  EXPECT_THAT(link.trouble(), HasSubstr(doubt));
  EXPECT_FALSE(link.connected());
  EXPECT_TRUE(wait_for([&] { return link.connected() && link.trouble().empty(); })) << link.trouble();
}

TEST_F(BadBroker, ThatConfirmsWhatItGetsIsDoubtedNoMore) {
  broker_.throws_out = true;
  auto settings = bad_link();
  settings.mqtt.lasting = std::chrono::hours(1);
  tpr_publisher::GroundLink link(settings);
  link.send(report(1));
  ASSERT_TRUE(comes_to_say(link, "is another client called")) << link.trouble();
  EXPECT_THAT(link.trouble(), HasSubstr("1 reports wait"));
  broker_.throws_out = false;
  EXPECT_TRUE(wait_for([&] { return link.connected() && link.trouble().empty(); })) << link.trouble();
}

// As of a train that has radio for a moment now and then.
TEST_F(BadBroker, ShortContactsOverWhichReportsAreConfirmedAreNoDoubt) {
  auto settings = bad_link();
  settings.mqtt.longest_retry_s = 60;
  const auto begun = std::chrono::steady_clock::now();
  tpr_publisher::GroundLink link(settings);
  const auto came = [&](uint64_t number) {
    const auto all = broker_.came();
    return !all.empty() && all.back().stamp_ns == static_cast<int64_t>(number);
  };
  for (uint64_t i = 1; i <= 10; ++i) {
    link.send(report(i));
    ASSERT_TRUE(wait_for([&] { return came(i) && link.connected() && link.trouble().empty(); })) << link.trouble();
    broker_.cut();
    ASSERT_TRUE(wait_for([&] { return broker_.connections() == static_cast<int>(i + 1); })) << link.trouble();
  }
  EXPECT_LT(std::chrono::steady_clock::now() - begun, std::chrono::seconds(40)) << "0.1 + 0.2 + ... + 51.2";
}

TEST_F(BadBroker, ThatSaysNothingIsCalledSilent) {
  broker_.lets_in = false;
  const tpr_publisher::GroundLink link(bad_link());
  ASSERT_TRUE(comes_to_say(link, "(it has not answered for 5 s)")) << link.trouble();
}

TEST_F(BadBroker, WhoseLimitsAreReachedIsNoMatterOfRights) {
  broker_.confirms_with = 0x97;
  tpr_publisher::GroundLink link(bad_link());
  link.send(report(1));
  ASSERT_TRUE(comes_to_say(link, "(Quota exceeded)")) << link.trouble();
  EXPECT_THAT(link.trouble(), Not(HasSubstr("acl_file")));
  broker_.confirms_with = 0;
  EXPECT_TRUE(wait_for([&] { return link.connected() && link.trouble().empty(); })) << link.trouble();
}

TEST_F(GroundLinkTest, TwoClientsWithOneIdAreTold) {
  test::Broker broker(file("broker"));
  ASSERT_TRUE(broker.start());
  Ground ground(broker.address(), train_);
  ASSERT_TRUE(ground.subscribed());
  auto settings = link_settings(broker.address());
  const tpr_publisher::GroundLink one(settings);
  settings.store = file("other.db");
  const tpr_publisher::GroundLink other(settings);
  const std::string doubt = "is another client called railfix-" + train_ + "?";
  EXPECT_TRUE(wait_for([&] {
    return one.trouble().find(doubt) != std::string::npos && other.trouble().find(doubt) != std::string::npos;
  })) << one.trouble()
      << '\n'
      << other.trouble();
}

}  // namespace
}  // namespace railfix
