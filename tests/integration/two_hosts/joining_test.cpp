// What the transport under DDS owes a train whose services are bound to the interface of the train network.
#include <algorithm>
#include <set>

#include "integration/two_hosts/two_hosts_train.hpp"

namespace railfix {
namespace {

using messaging::Participant;

class JoiningTest : public TwoHostsTest {
 protected:
  std::unique_ptr<Participant> join() { return join_in_cab(train_); }
  bool shell_on(TwoHosts::Host host, const std::string& command) {
    return hosts_.on(host, [&] { return std::system(command.c_str()) == 0; });
  }
  uint64_t datagrams_in_cab() {
    return hosts_.on(TwoHosts::cab, [] {
      std::ifstream table("/proc/thread-self/net/snmp");
      std::string word;
      uint64_t received = 0;
      for (int lines = 0; lines < 2 && table >> word;) {
        if (word == "Udp:" && ++lines == 2) table >> received;
      }
      return received;
    });
  }
};

// Everybody says each second that he is there. Who joins must not need that: he asks, and hears every answer. Before,
// answers that came while his sockets were not listened to yet were lost, and half of the neighbours were found later.
TEST_F(JoiningTest, WhoJoinsKnowsHisNeighboursBeforeTheySpeakUpAgain) {
  constexpr size_t kNeighbours = 8;
  std::vector<std::unique_ptr<Participant>> neighbours;
  std::vector<std::unique_ptr<messaging::Writer<msg::ServiceStatus>>> writers;
  for (size_t i = 0; i < kNeighbours; ++i) {
    neighbours.push_back(join());
    writers.push_back(std::make_unique<messaging::Writer<msg::ServiceStatus>>(
        *neighbours.back(), topics::service_status, std::to_string(i)));
  }
  ASSERT_TRUE(run_until([&] { return cab_->written_topics().size() == kNeighbours; }));
  // A computer that holds everybody up now and then spoils a round, not every one of five.
  double sixth_s = 1e9;
  std::vector<double> all_s;
  for (int round = 0; round < 5 && sixth_s >= 0.5; ++round) {
    std::vector<double> took_s;
    for (int time = 0; time < 7; ++time) {
      const int64_t began_ns = core::monotonic_ns();
      const auto newcomer = join();
      ASSERT_TRUE(run_until([&] { return newcomer->written_topics().size() == kNeighbours; }));
      took_s.push_back(core::seconds(core::monotonic_ns() - began_ns));
    }
    all_s.insert(all_s.end(), took_s.begin(), took_s.end());
    std::ranges::sort(took_s);
    std::cout << "joined after " << ::testing::PrintToString(took_s) << " s\n";
    sixth_s = took_s[5];
  }
  EXPECT_LT(sixth_s, 0.5) << "all but one of seven";
  std::ranges::sort(all_s);
  EXPECT_LT(all_s[all_s.size() / 2], 0.5);
}

TEST_F(JoiningTest, ANeighbourGetsASampleOnceNotFromEveryInterface) {
  constexpr uint64_t kSamples = 500;
  auto info = messaging::info_of(topics::train_state);
  info.qos.reliable = false;  // no acknowledgements: they would count
  uint64_t heard = 0;
  const auto neighbour = join();
  messaging::AnyReader reader(*neighbour, info, "", queue_, [&](const auto&, const auto&) { ++heard; });
  messaging::Writer<msg::TrainState> writer(*cab_, topics::train_state);
  ASSERT_TRUE(run_until([&] { return writer.matched_readers() == 1 && writer.write({}) && heard > 0; }));
  const uint64_t before = datagrams_in_cab();
  for (uint64_t i = 0; i < kSamples; ++i) {
    const uint64_t heard_before = heard;
    writer.write({});
    ASSERT_TRUE(run_until([&] { return heard > heard_before; }));
  }
  const uint64_t datagrams = datagrams_in_cab() - before;
  std::cout << datagrams << " datagrams for " << kSamples << " samples\n";
  EXPECT_LT(datagrams, kSamples * 3 / 2);
}

// A switch on a train may pass no multicast: then the addresses of the peers must do.
TEST_F(JoiningTest, HostsFindEachOtherWithoutMulticast) {
  for (const auto host : {TwoHosts::cab, TwoHosts::coach}) {
    if (!shell_on(host, "iptables -A INPUT -d 224.0.0.0/4 -j DROP")) GTEST_SKIP() << "skipped: iptables is not here";
  }
  auto reports = start(TwoHosts::coach, "railfix-tpr-publisher");
  std::set<std::string> services;
  messaging::Reader<msg::ServiceStatus> status(
      *cab_, topics::service_status, "", queue_,
      [&](const msg::ServiceStatus& one) { services.insert(one.service().c_str()); });
  EXPECT_TRUE(run_until([&] { return services.contains("tpr_publisher"); }));
}

// Passengers' network, another train's: what is not named in the manifest hears nothing.
TEST_F(JoiningTest, AnInterfaceThatIsNotNamedStaysSilent) {
  const bool made =
      shell_on(TwoHosts::cab,
               "ip link add other0 type veth peer name other1 && ip address add 10.43.1.1/24 dev other0 && "
               "ip link set other0 up && ip link set other1 up && "
               "iptables -A OUTPUT -o other0 -p udp -j ACCEPT && iptables -A OUTPUT -o train0 -p udp -j ACCEPT");
  if (!made) GTEST_SKIP() << "skipped: iptables is not here";
  const auto participant = join();
  messaging::Writer<msg::TrainState> writer(*participant, topics::train_state);
  auto monitor = start(TwoHosts::coach, "railfix-monitor", {"monitor.port=0", "monitor.foxglove_port=-1"});
  ASSERT_TRUE(run_until([&] { return writer.write({}) && writer.matched_readers() > 0; }));
  // Each rule's packets come first in its line.
  EXPECT_TRUE(shell_on(TwoHosts::cab, "iptables -nvxL OUTPUT | awk '/train0/ { exit !($1 > 0) }'"));
  EXPECT_TRUE(shell_on(TwoHosts::cab, "iptables -nvxL OUTPUT | awk '/other0/ { exit !($1 == 0) }'"));
}

}  // namespace
}  // namespace railfix
