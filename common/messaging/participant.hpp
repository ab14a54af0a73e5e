// Private to this folder: the inside of a Participant.
#pragma once

#include <atomic>
#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantListener.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fastdds/dds/topic/Topic.hpp>
#include <map>
#include <optional>
#include <set>

#include "messaging/messaging.hpp"
#include "messaging/qos_terms.hpp"

namespace railfix::messaging {

/// One writer's samples, counted; outlives the writer.
struct SentCount {
  explicit SentCount(std::string name) : topic(std::move(name)) {}
  std::string topic;
  std::atomic<uint64_t> samples = 0;
};

struct Participant::Impl : eprosima::fastdds::dds::DomainParticipantListener {
  ParticipantOptions options;
  size_t running_interfaces = 0;                     // when this participant joined
  std::shared_ptr<std::mutex> discovery;             // held where a reader or writer goes away (see transport.hpp)
  std::shared_ptr<std::atomic<uint64_t>> handed_on;  // messages to the discovery
  int64_t looked_ns = 0;
  uint64_t at_message = 0;                     // of them, when it was looked at last ...
  std::optional<int64_t> at_message_since_ns;  // ... and since when
  eprosima::fastdds::dds::DomainParticipant* participant = nullptr;
  /// Where writers and readers live: those of the whole train, and those of topics that stay in this host's memory.
  struct Ends {
    std::string partition;
    eprosima::fastdds::dds::Publisher* publisher = nullptr;
    eprosima::fastdds::dds::Subscriber* subscriber = nullptr;
  };
  Ends train;
  Ends host;
  Ends& ends_of(const TopicInfo& info) { return info.qos.data_sharing ? host : train; }
  void join(Ends& ends);

  std::mutex mutex;
  std::map<std::string, eprosima::fastdds::dds::Topic*> topics;
  // Who holds this one may wait for an endpoint inside the middleware, so that no callback of the middleware may want
  // it.
  std::mutex own_mutex;
  std::set<eprosima::fastdds::dds::DataWriter*> writers;
  std::set<eprosima::fastdds::dds::DataReader*> readers;
  std::vector<std::shared_ptr<const SentCount>> sent;
  struct Remote {
    std::string topic;
    Terms terms;
    std::optional<int64_t> out_of_reach_since_ns = {};  // a reader that no writer here may match (monotonic clock)
  };
  std::map<eprosima::fastrtps::rtps::GUID_t, Remote> remote_writers;
  std::map<eprosima::fastrtps::rtps::GUID_t, Remote> remote_readers;
  // Asked for by readers, inside the middleware: this mutex is held for nothing else.
  std::mutex layouts_mutex;
  std::map<uint64_t, uint64_t> layouts;  // of remote writers, by SampleInfo::writer
  /// 0 = not known.
  uint64_t layout_of_writer(uint64_t writer);
  struct Process {
    std::string name;                 // "odometry@cab"
    int64_t certificate_ends_ns = 0;  // 0 = it has none
  };
  std::map<eprosima::fastrtps::rtps::GuidPrefix_t, Process> remote_processes;
  int64_t certificate_ends_ns = 0;  // own, 0 = none
  bool own_profiles = false;

  eprosima::fastdds::dds::Topic* topic(const TopicInfo& info, const std::string& instance);
  void on_participant_discovery(eprosima::fastdds::dds::DomainParticipant*,
                                eprosima::fastrtps::rtps::ParticipantDiscoveryInfo&& info) override;
  void on_publisher_discovery(eprosima::fastdds::dds::DomainParticipant*,
                              eprosima::fastrtps::rtps::WriterDiscoveryInfo&& info) override;
  void on_subscriber_discovery(eprosima::fastdds::dds::DomainParticipant*,
                               eprosima::fastrtps::rtps::ReaderDiscoveryInfo&& info) override;
};

}  // namespace railfix::messaging
