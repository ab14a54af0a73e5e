#include "messaging/participant.hpp"

#include <fastrtps/utils/IPLocator.h>
#include <fastrtps/xmlparser/XMLProfileManager.h>
#include <algorithm>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <mutex>
#include <utility>

#include "core/time.hpp"
#include "messaging/fastdds_types.hpp"
#include "messaging/layout.hpp"
#include "messaging/network.hpp"
#include "messaging/security.hpp"
#include "messaging/shared_memory.hpp"
#include "messaging/topics.hpp"
#include "messaging/transport.hpp"

namespace railfix::messaging {
namespace {

namespace dds = eprosima::fastdds::dds;
namespace rtps = eprosima::fastdds::rtps;

constexpr uint32_t kSocketBufferBytes = 4U << 20U;
// Dead participants vanish after the lease; the default of 20 s would show ghosts.
constexpr int32_t kParticipantLeaseS = 5;
constexpr int32_t kAnnouncementS = 1;
// The first announcement that is heard comes so long after the participant is made.
constexpr uint32_t kFirstAnnouncementNs = 20'000'000;
// A message of the discovery takes milliseconds, with certificates some tens of them.
constexpr int64_t kLongestMessageNs = 5 * core::kNsPerSecond;
constexpr int64_t kLookedAwayNs = core::kNsPerSecond;  // a process that was stopped has not waited for itself
// Participants of one host that a peer is asked for: every service twice (standby, swap) and a few tools.
constexpr uint32_t kParticipantsOfHost = 32;

// Peers replace Fast DDS's own list, so this host is named, too. Port 0: those of the domain.
rtps::LocatorList initial_peers(const std::vector<std::string>& peers) {
  rtps::LocatorList list;
  std::vector<std::string> addresses = peers;
  addresses.emplace_back("127.0.0.1");
  for (const auto& address : addresses) {
    eprosima::fastrtps::rtps::Locator_t locator;
    locator.kind = LOCATOR_KIND_UDPv4;
    if (!eprosima::fastrtps::rtps::IPLocator::setIPv4(locator, address)) {
      throw core::BadInput("peer '" + address +
                           "' is not an IPv4 address; give the other host's address on the train network");
    }
    list.push_back(locator);
  }
  return list;
}

// Participants of one process talk as those of two do. The short cut that 2.9.1 takes between them keeps pointers to
// endpoints of a participant that may be leaving (eProsima/Fast-DDS#2199).
void forbid_short_cuts() {
  eprosima::fastrtps::LibrarySettingsAttributes settings;
  settings.intraprocess_delivery = eprosima::fastrtps::INTRAPROCESS_OFF;
  eprosima::fastrtps::xmlparser::XMLProfileManager::library_settings(settings);
}

std::string name_of(const ParticipantOptions& options) {
  return options.service + "@" + options.host;
}

// No shared-memory transport: in 2.9.1 a process that is killed and started again makes its queue anew, while those
// that ran on write to the old one for ever (eProsima/Fast-DDS#4728), and a stopped one spins. Pictures are shared in
// memory by data sharing, which does not need it.
std::shared_ptr<TrainTransport> transport_of(const ParticipantOptions& options) {
  auto udp = std::make_shared<rtps::UDPv4TransportDescriptor>();
  udp->sendBufferSize = kSocketBufferBytes;
  udp->receiveBufferSize = kSocketBufferBytes;
  udp->non_blocking_send = true;
  udp->maxInitialPeersRange = kParticipantsOfHost;
  udp->interfaceWhiteList = core::value_or_throw(addresses_of(options.interfaces));
  return std::make_shared<TrainTransport>(std::move(udp));
}

dds::DomainParticipantQos participant_qos(const ParticipantOptions& options,
                                          const std::shared_ptr<TrainTransport>& transport) {
  dds::DomainParticipantQos qos;
  qos.name(name_of(options));
  qos.transport().use_builtin_transports = false;
  qos.transport().user_transports.push_back(transport);
  auto& discovery = qos.wire_protocol().builtin.discovery_config;
  discovery.leaseDuration = {kParticipantLeaseS, 0};
  discovery.leaseDuration_announcementperiod = {kAnnouncementS, 0};
  discovery.initial_announcements.period = {0, kFirstAnnouncementNs};
  if (!options.peers.empty()) qos.wire_protocol().builtin.initialPeersList = initial_peers(options.peers);
  for (const auto& [name, value] :
       core::value_or_throw(security_properties(options.security_folder, options.service))) {
    qos.properties().properties().emplace_back(name, value);
  }
  return qos;
}

}  // namespace

dds::Topic* Participant::Impl::topic(const TopicInfo& info, const std::string& instance) {
  const std::string name = instance.empty() ? info.name : info.name + "/" + instance;
  const std::lock_guard lock(mutex);
  auto& topic = topics[name];
  if (topic == nullptr) {
    const auto support = fastdds(*info.type).support();
    support.register_type(participant);
    topic = participant->create_topic(name, info.type->name(), dds::TOPIC_QOS_DEFAULT);
    if (topic == nullptr)
      throw core::BadInput("topic " + name + " cannot be made on DDS domain " + std::to_string(options.domain));
  }
  return topic;
}

namespace {

// What a participant says of itself beside its name, to everybody who discovers it.
constexpr std::string_view kCertificateEnds = "certificate_ends_ns=";

std::vector<uint8_t> user_data_of(int64_t certificate_ends_ns) {
  if (certificate_ends_ns == 0) return {};
  const std::string text = std::string(kCertificateEnds) + std::to_string(certificate_ends_ns);
  return {text.begin(), text.end()};
}

int64_t certificate_ends_in(const std::vector<uint8_t>& user_data) {
  const std::string text(user_data.begin(), user_data.end());
  return text.starts_with(kCertificateEnds) ? std::strtoll(text.c_str() + kCertificateEnds.size(), nullptr, 10) : 0;
}

// Keeps one remote endpoint of this train, or forgets it. Fast DDS tells of our own endpoints too.
template <class Known, class Endpoint>
void note(Known& known, const Endpoint& endpoint, bool removed, const std::vector<std::string>& own_partitions,
          const dds::DomainParticipant& own) {
  if (endpoint.guid().guidPrefix == own.guid().guidPrefix) return;
  if (removed) {
    known.erase(endpoint.guid());
    return;
  }
  const auto partitions = endpoint.m_qos.m_partition.getNames();
  if (std::find_first_of(partitions.begin(), partitions.end(), own_partitions.begin(), own_partitions.end()) ==
      partitions.end())
    return;
  known[endpoint.guid()] = {endpoint.topicName().to_string(), terms_of(endpoint.m_qos)};
}

// 2.9.1 sends the next sample for ever, with all locks held, to a reader on the network without an address
// (StatefulWriter::deliver_sample_to_network). For one it takes a reader in shared memory, too, that has no place where
// this process may call it (ReaderLocator::start): it went before the writer heard of it, is another user's, or has a
// /dev/shm of its own. What is left: a reader that goes between this look and the match, and a writer that is made
// after such a reader was heard of.
bool is_out_of_reach(const eprosima::fastrtps::rtps::ReaderProxyData& reader) {
  const auto* topic = find_topic(reader.topicName().to_string());
  const bool shares = topic != nullptr && topic->qos.data_sharing && !reader.m_qos.data_sharing.domain_ids().empty();
  if (shares) return !has_shared_memory(reader.guid());
  return reader.remote_locators().unicast.empty() && reader.remote_locators().multicast.empty();
}

// No writer matches it: what is matched next is this very object, which Fast DDS only shows.
void keep_apart(const eprosima::fastrtps::rtps::ReaderProxyData& reader) {
  auto& partition = const_cast<eprosima::fastrtps::rtps::ReaderProxyData&>(reader).m_qos.m_partition;
  partition.clear();
  partition.push_back("gone");
}

}  // namespace

void Participant::Impl::on_participant_discovery(dds::DomainParticipant*,
                                                 eprosima::fastrtps::rtps::ParticipantDiscoveryInfo&& info) {
  using Info = eprosima::fastrtps::rtps::ParticipantDiscoveryInfo;
  const std::lock_guard lock(mutex);
  const auto& prefix = info.info.m_guid.guidPrefix;
  if (info.status == Info::REMOVED_PARTICIPANT || info.status == Info::DROPPED_PARTICIPANT) {
    remote_processes.erase(prefix);
  } else {
    remote_processes[prefix] = {info.info.m_participantName.to_string(), certificate_ends_in(info.info.m_userData)};
  }
}

uint64_t Participant::Impl::layout_of_writer(uint64_t writer) {
  const std::lock_guard lock(layouts_mutex);
  const auto known = layouts.find(writer);
  return known == layouts.end() ? 0 : known->second;
}

void Participant::Impl::on_publisher_discovery(dds::DomainParticipant* own,
                                               eprosima::fastrtps::rtps::WriterDiscoveryInfo&& info) {
  {
    const std::lock_guard lock(layouts_mutex);
    const uint64_t writer = number_of(info.info.guid());
    if (info.status == eprosima::fastrtps::rtps::WriterDiscoveryInfo::REMOVED_WRITER) {
      layouts.erase(writer);
    } else {
      layouts[writer] = layout_in(info.info.m_qos.m_userData.data_vec());
    }
  }
  const std::lock_guard lock(mutex);
  note(remote_writers, info.info, info.status == eprosima::fastrtps::rtps::WriterDiscoveryInfo::REMOVED_WRITER,
       {train.partition, host.partition}, *own);
}

void Participant::Impl::on_subscriber_discovery(dds::DomainParticipant* own,
                                                eprosima::fastrtps::rtps::ReaderDiscoveryInfo&& info) {
  const bool removed = info.status == eprosima::fastrtps::rtps::ReaderDiscoveryInfo::REMOVED_READER;
  const bool is_own = info.info.guid().guidPrefix == own->guid().guidPrefix;
  const bool apart = !removed && !is_own && is_out_of_reach(info.info);
  const std::lock_guard lock(mutex);
  note(remote_readers, info.info, removed, {train.partition, host.partition}, *own);
  if (!apart) return;
  if (const auto known = remote_readers.find(info.info.guid()); known != remote_readers.end())
    known->second.out_of_reach_since_ns = core::monotonic_ns();
  keep_apart(info.info);
}

void Participant::Impl::join(Ends& ends) {
  dds::PublisherQos publisher_qos;
  publisher_qos.partition().push_back(ends.partition.c_str());
  ends.publisher = participant->create_publisher(publisher_qos);
  dds::SubscriberQos subscriber_qos;
  subscriber_qos.partition().push_back(ends.partition.c_str());
  ends.subscriber = participant->create_subscriber(subscriber_qos);
}

Participant::Participant(const ParticipantOptions& options) : impl_(std::make_unique<Impl>()) {
  static std::once_flag once;
  std::call_once(once, forbid_short_cuts);
  impl_->options = options;
  auto* factory = dds::DomainParticipantFactory::get_instance();
  if (!options.qos_profiles.empty()) {
    if (factory->load_XML_profiles_file(options.qos_profiles) != ReturnCode_t::RETCODE_OK) {
      throw core::BadInput(options.qos_profiles +
                           " is not a Fast DDS profile file; start from deploy/qos/railfix_qos.xml");
    }
    impl_->own_profiles = true;
  }
  if (options.domain < 0 || options.domain > 232) {
    throw core::BadInput("DDS domain " + std::to_string(options.domain) + " is not in 0..232");
  }
  impl_->running_interfaces = running_interfaces(options.interfaces);
  impl_->train.partition = "train/" + options.train_id;
  impl_->host.partition = impl_->train.partition + "/memory/" + memory_id();
  const auto transport = transport_of(options);
  impl_->discovery = transport->discovery;
  impl_->handed_on = transport->handed_on;
  auto qos = participant_qos(options, transport);
  if (!options.security_folder.empty()) {
    impl_->certificate_ends_ns =
        core::value_or_throw(certificate_ends_ns(certificate_of(options.security_folder, options.service)));
  }
  qos.user_data().data_vec(user_data_of(impl_->certificate_ends_ns));
  impl_->participant =
      factory->create_participant(static_cast<uint32_t>(options.domain), qos, impl_.get(), dds::StatusMask::none());
  if (impl_->participant == nullptr) {
    throw core::BadInput("cannot join DDS domain " + std::to_string(options.domain) +
                         "; check that the network of this host is up (`ip link set lo up` at least)");
  }
  *transport->open = true;
  for (auto* ends : {&impl_->train, &impl_->host}) impl_->join(*ends);
}

Participant::~Participant() {
  if (impl_->participant == nullptr) return;
  impl_->participant->set_listener(nullptr);
  impl_->participant->delete_contained_entities();
  dds::DomainParticipantFactory::get_instance()->delete_participant(impl_->participant);
}

bool Participant::discovery_goes_on(int64_t now_ns) {
  const std::unique_lock at_rest(*impl_->discovery, std::try_to_lock);
  auto& since_ns = impl_->at_message_since_ns;
  if (at_rest) {
    since_ns.reset();
    return true;
  }
  const uint64_t message = *impl_->handed_on;
  const bool looked_away = now_ns - std::exchange(impl_->looked_ns, now_ns) > kLookedAwayNs;
  if (!since_ns || message != impl_->at_message || looked_away) since_ns = now_ns;
  impl_->at_message = message;
  return now_ns - *since_ns < kLongestMessageNs;
}

bool Participant::interface_appeared() const {
  return running_interfaces(impl_->options.interfaces) > impl_->running_interfaces;
}

Connections Participant::connections() const {
  const std::lock_guard own_lock(impl_->own_mutex);
  Connections connections;
  connections.endpoints = static_cast<uint32_t>(impl_->writers.size() + impl_->readers.size());
  std::map<std::string, std::pair<uint32_t, uint32_t>> ends;  // topic -> writers, readers
  for (auto* writer : impl_->writers) {
    dds::PublicationMatchedStatus status;
    writer->get_publication_matched_status(status);
    connections.matches += static_cast<uint32_t>(status.current_count);
    ++ends[writer->get_topic()->get_name()].first;
  }
  for (auto* reader : impl_->readers) {
    dds::SubscriptionMatchedStatus status;
    reader->get_subscription_matched_status(status);
    connections.matches += static_cast<uint32_t>(status.current_count);
    ++ends[reader->get_topicdescription()->get_name()].second;
  }
  const std::lock_guard lock(impl_->mutex);
  connections.remote_endpoints = static_cast<uint32_t>(impl_->remote_writers.size());
  for (const auto& [guid, writer] : impl_->remote_writers) ++ends[writer.topic].first;
  for (const auto& [guid, reader] : impl_->remote_readers) {
    if (reader.out_of_reach_since_ns) continue;
    ++connections.remote_endpoints;
    ++ends[reader.topic].second;
  }
  for (const auto& [topic, counts] : ends) connections.pairs += counts.first * counts.second;
  return connections;
}

std::vector<Sent> Participant::sent() const {
  const std::lock_guard lock(impl_->own_mutex);
  std::vector<Sent> sent;
  for (const auto& count : impl_->sent) sent.push_back({count->topic, count->samples});
  return sent;
}

// Anybody on the network can announce himself; only who has a certificate of this train gets his writers known.
std::vector<CertificateEnd> Participant::certificates() const {
  const std::lock_guard lock(impl_->mutex);
  std::set<eprosima::fastrtps::rtps::GuidPrefix_t> known;
  for (const auto& [guid, writer] : impl_->remote_writers) known.insert(guid.guidPrefix);
  std::vector<CertificateEnd> all;
  for (const auto& [prefix, process] : impl_->remote_processes) {
    if (process.certificate_ends_ns != 0 && known.contains(prefix))
      all.push_back({process.name, process.certificate_ends_ns});
  }
  if (const int64_t own_ns = impl_->certificate_ends_ns; own_ns != 0) all.push_back({name_of(impl_->options), own_ns});
  std::ranges::sort(all, {}, &CertificateEnd::process);
  return all;
}

std::vector<std::string> Participant::written_topics() const {
  const std::lock_guard lock(impl_->mutex);
  std::vector<std::string> names;
  for (const auto& [guid, writer] : impl_->remote_writers) names.push_back(writer.topic);
  std::sort(names.begin(), names.end());
  names.erase(std::unique(names.begin(), names.end()), names.end());
  return names;
}

}  // namespace railfix::messaging
