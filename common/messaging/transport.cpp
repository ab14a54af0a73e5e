#include "messaging/transport.hpp"

#include <fastdds/rtps/network/SenderResource.h>
#include <fastdds/rtps/transport/ChainingTransport.h>
#include <fastrtps/utils/IPLocator.h>

#include <map>
#include <mutex>

namespace railfix::messaging {
namespace {

namespace rtps = eprosima::fastdds::rtps;
using eprosima::fastrtps::rtps::IPLocator;
using eprosima::fastrtps::rtps::Locator_t;
using eprosima::fastrtps::rtps::LocatorList_t;
using eprosima::fastrtps::rtps::SenderResource;

/// What a socket sends to.
enum class Reach { all, loopback, network };

bool reaches(Reach reach, const Locator_t& destination) {
  if (reach == Reach::all || IPLocator::isMulticast(destination)) return true;
  return IPLocator::isLocal(destination) == (reach == Reach::loopback);
}

// Fast DDS's interface has a destructor that is not virtual; nobody deletes through it.
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wnon-virtual-dtor"

/// Those of a list of destinations that a socket reaches.
class Reached final : public rtps::LocatorsIterator {
 public:
  Reached(rtps::LocatorsIterator& at, const rtps::LocatorsIterator& end, Reach reach)
      : at_(at), end_(end), reach_(reach) {
    skip();
  }
  LocatorsIterator& operator++() override {
    ++at_;
    skip();
    return *this;
  }
  bool operator==(const LocatorsIterator& other) const override { return at_ == other; }
  bool operator!=(const LocatorsIterator& other) const override { return at_ != other; }
  const Locator_t& operator*() const override { return *at_; }

 private:
  void skip() {
    while (at_ != end_ && !reaches(reach_, *at_)) ++at_;
  }
  rtps::LocatorsIterator& at_;
  const rtps::LocatorsIterator& end_;
  Reach reach_;
};

#pragma GCC diagnostic pop

class Transport final : public rtps::ChainingTransport {
 public:
  explicit Transport(const TrainTransport& descriptor) : ChainingTransport(descriptor), descriptor_(descriptor) {}
  rtps::TransportDescriptorInterface* get_configuration() override { return &descriptor_; }

  bool send(SenderResource* socket, const eprosima::fastrtps::rtps::octet* bytes, uint32_t size,
            rtps::LocatorsIterator* begin, rtps::LocatorsIterator* end,
            const std::chrono::steady_clock::time_point& until) override {
    if (!*descriptor_.open) return true;
    Reached reached(*begin, *end, reach_of(*socket));
    return socket->send(bytes, size, &reached, end, until);
  }

  void receive(rtps::TransportReceiverInterface* next, const eprosima::fastrtps::rtps::octet* bytes, uint32_t size,
               const Locator_t& local, const Locator_t& remote) override {
    if (!*descriptor_.open) return;
    std::unique_lock one_at_a_time(*descriptor_.discovery, std::defer_lock);
    if (is_of_discovery(local)) {
      one_at_a_time.lock();
      ++*descriptor_.handed_on;
    }
    next->OnDataReceived(bytes, size, local, remote);
  }

 private:
  // Ports of discovery and of samples alternate (DDSI-RTPS 2.2, 9.6.1).
  static bool is_of_discovery(const Locator_t& local) {
    const eprosima::fastrtps::rtps::PortParameters ports;
    return (IPLocator::getPhysicalPort(local) - ports.portBase) % ports.participantIDGain == ports.offsetd0;
  }

  // A socket tells its address by a call to the kernel and with memory taken, so it is asked once.
  Reach reach_of(const SenderResource& socket) {
    const std::lock_guard lock(mutex_);
    const auto [known, is_new] = reach_.try_emplace(&socket, Reach::all);
    if (is_new) {
      LocatorList_t own;
      socket.add_locators_to_list(own);
      if (own.size() == 1 && !IPLocator::isAny(*own.begin()))
        known->second = IPLocator::isLocal(*own.begin()) ? Reach::loopback : Reach::network;
    }
    return known->second;
  }

  TrainTransport descriptor_;
  std::mutex mutex_;
  std::map<const SenderResource*, Reach> reach_;  // sockets live as long as this
};

}  // namespace

rtps::TransportInterface* TrainTransport::create_transport() const {
  return new Transport(*this);
}

}  // namespace railfix::messaging
