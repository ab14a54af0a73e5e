// A client that does not take a report for a while, over a connection that stays: the library's call by which it does.
#include <dlfcn.h>

#include <atomic>

#include "integration/tpr/ground_link_fixture.hpp"

namespace {

std::atomic<bool> memory_is_short = false;
constexpr int kNoMemory = 1;  // MOSQ_ERR_NOMEM

}  // namespace

struct mosquitto;
using Publish = int (*)(mosquitto*, int*, const char*, int, const void*, int, bool);

extern "C" int mosquitto_publish(mosquitto* client, int* id, const char* topic, int bytes, const void* payload, int qos,
                                 bool retain) {
  static const auto library = reinterpret_cast<Publish>(dlsym(RTLD_NEXT, "mosquitto_publish"));
  return memory_is_short ? kNoMemory : library(client, id, topic, bytes, payload, qos, retain);
}

namespace railfix {
namespace {

using ::testing::HasSubstr;

TEST_F(GroundLinkTest, AReportThatTheClientDidNotTakeIsGivenAgainAndTheLinkIsWellThen) {
  test::Broker broker(file("broker"));
  ASSERT_TRUE(broker.start());
  Ground ground(broker.address(), train_);
  ASSERT_TRUE(ground.subscribed());
  tpr_publisher::GroundLink link(link_settings(broker.address()));
  link.send(report(1));
  ASSERT_TRUE(wait_for([&] { return ground.count() == 1 && link.connected(); })) << link.trouble();
  memory_is_short = true;
  link.send(report(2));
  const bool told = wait_for([&] { return !link.connected(); });
  EXPECT_THAT(link.trouble(), HasSubstr("Ground link: a report cannot be given to " + broker.address() + " ("));
  EXPECT_THAT(link.trouble(), HasSubstr("; 1 reports wait."));
  memory_is_short = false;
  ASSERT_TRUE(told);
  // Nothing else happens: a standby may have taken charge meanwhile, and makes the reports.
  ASSERT_TRUE(wait_for([&] { return ground.count() == 2; })) << link.trouble();
  EXPECT_TRUE(wait_for([&] { return link.connected() && link.trouble().empty(); })) << link.trouble();
}

}  // namespace
}  // namespace railfix
