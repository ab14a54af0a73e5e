// Private to this folder: Fast DDS's UDP, with three habits of 2.9.1 mended that cost a train of many participants
// time, or a connection.
//
// - A participant announces itself before its own sockets are listened to (RTPSParticipantImpl::enable), and everybody
//   answers an announcement once: the fastest answers were lost, and their senders found only with their next regular
//   announcement, up to a period later. Here nothing is said and nothing heard before the participant is whole.
// - With an interface whitelist every datagram is sent by the socket of every interface: twice to each neighbour in
//   this host. Here the loopback's socket serves loopback addresses, and the others the rest.
// - Each socket is listened to by a thread of its own, and participants that are discovered by two of them at once
//   share one record (SecurityManager::match_builtin_endpoints): with certificates, one of them was never let in. Here
//   what comes for the discovery is handed on by one thread at a time, and none while a reader or writer goes away: one
//   that is just being matched would be told of it when it is gone (eProsima/Fast-DDS#3303).
#pragma once

#include <fastdds/rtps/transport/ChainingTransportDescriptor.h>
#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>

#include <atomic>
#include <memory>
#include <mutex>

namespace railfix::messaging {

struct TrainTransport : eprosima::fastdds::rtps::ChainingTransportDescriptor {
  explicit TrainTransport(std::shared_ptr<eprosima::fastdds::rtps::UDPv4TransportDescriptor> udp)
      : ChainingTransportDescriptor(std::move(udp)) {}
  [[nodiscard]] eprosima::fastdds::rtps::TransportInterface* create_transport() const override;

  /// Whether the participant is whole; set once, by who made it.
  std::shared_ptr<std::atomic<bool>> open = std::make_shared<std::atomic<bool>>(false);
  /// Held while something is handed on to the discovery.
  std::shared_ptr<std::mutex> discovery = std::make_shared<std::mutex>();
  /// Messages that were handed on to it.
  std::shared_ptr<std::atomic<uint64_t>> handed_on = std::make_shared<std::atomic<uint64_t>>(0);
};

}  // namespace railfix::messaging
