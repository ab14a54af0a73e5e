// What the transport under DDS owes a train whose services are bound to the interface of the train network.
#include <algorithm>

#include "integration/two_hosts/two_hosts_train.hpp"

namespace railfix {
namespace {

using messaging::Participant;

class JoiningTest : public TwoHostsTest {
 protected:
  messaging::ParticipantOptions in_cab() const {
    messaging::ParticipantOptions options;
    options.train_id = train_;
    options.domain = kDomain;
    options.interfaces = {TwoHosts::kInterface[TwoHosts::cab]};
    options.peers = {TwoHosts::kAddress[TwoHosts::coach]};
    return options;
  }
  std::unique_ptr<Participant> join() {
    return hosts_.on(TwoHosts::cab, [&] { return std::make_unique<Participant>(in_cab()); });
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
  std::vector<double> took_s;
  for (int time = 0; time < 7; ++time) {
    const int64_t began_ns = core::monotonic_ns();
    const auto newcomer = join();
    ASSERT_TRUE(run_until([&] { return newcomer->written_topics().size() == kNeighbours; }));
    took_s.push_back(core::seconds(core::monotonic_ns() - began_ns));
  }
  std::ranges::sort(took_s);
  std::cout << "joined after " << ::testing::PrintToString(took_s) << " s\n";
  EXPECT_LT(took_s[5], 0.5) << "all but one of seven";
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

}  // namespace
}  // namespace railfix
