#include "messaging/qos_match.hpp"

#include <fastrtps/xmlparser/XMLProfileManager.h>

#include "messaging/fastdds_qos.hpp"
#include "messaging/topics.hpp"

namespace railfix::messaging {
namespace {

namespace dds = eprosima::fastdds::dds;
using Profiles = eprosima::fastrtps::xmlparser::XMLProfileManager;

/// What decides whether a writer and a reader match.
struct Terms {
  bool reliable = false;
  bool transient_local = false;
  bool exclusive = false;
  int64_t deadline_ns = 0;
  int64_t lease_ns = 0;
  int liveliness = 0;
};

template <class Qos>
Terms terms_of(const Qos& qos) {
  return {qos.m_reliability.kind == dds::RELIABLE_RELIABILITY_QOS,
          qos.m_durability.kind >= dds::TRANSIENT_LOCAL_DURABILITY_QOS,
          qos.m_ownership.kind == dds::EXCLUSIVE_OWNERSHIP_QOS,
          qos.m_deadline.period.to_ns(),
          qos.m_liveliness.lease_duration.to_ns(),
          static_cast<int>(qos.m_liveliness.kind)};
}
Terms built_in(const TopicInfo& topic, bool writer) {
  dds::DataReaderQos qos;
  apply(topic.qos, qos);
  return {writer ? topic.qos.writer_reliable : topic.qos.reliable,
          topic.qos.transient_local,
          false,
          qos.deadline().period.to_ns(),
          qos.liveliness().lease_duration.to_ns(),
          static_cast<int>(qos.liveliness().kind)};
}

// Fast DDS says nothing of a profile that is not there but on its own log.
Terms offered(const TopicInfo& topic) {
  eprosima::fastrtps::PublisherAttributes attributes;
  const bool given = Profiles::fillPublisherAttributes(topic.name, attributes, false) ==
                     eprosima::fastrtps::xmlparser::XMLP_ret::XML_OK;
  return given ? terms_of(attributes.qos) : built_in(topic, true);
}
Terms requested(const TopicInfo& topic) {
  eprosima::fastrtps::SubscriberAttributes attributes;
  const bool given = Profiles::fillSubscriberAttributes(topic.name, attributes, false) ==
                     eprosima::fastrtps::xmlparser::XMLP_ret::XML_OK;
  return given ? terms_of(attributes.qos) : built_in(topic, false);
}

std::string mismatch(const Terms& writer, const Terms& reader) {
  if (reader.reliable && !writer.reliable) return "the reader wants RELIABLE, the writer offers BEST_EFFORT";
  if (reader.transient_local && !writer.transient_local)
    return "the reader wants TRANSIENT_LOCAL, the writer offers VOLATILE";
  if (reader.exclusive != writer.exclusive)
    return "one of reader and writer has EXCLUSIVE ownership, the other has not";
  if (reader.deadline_ns < writer.deadline_ns) return "the reader's deadline is shorter than the writer's";
  if (reader.liveliness > writer.liveliness) return "the reader wants a stricter liveliness than the writer offers";
  if (reader.lease_ns < writer.lease_ns) return "the reader's liveliness lease is shorter than the writer's";
  return "";
}

}  // namespace

core::Result<std::vector<std::string>> qos_mismatches(const std::filesystem::path& profiles) {
  if (Profiles::loadXMLFile(profiles.string()) != eprosima::fastrtps::xmlparser::XMLP_ret::XML_OK)
    return core::Error{profiles.string() + " is not a Fast DDS profile file; start from deploy/qos/railfix_qos.xml"};
  std::vector<std::string> problems;
  for (const auto& topic : all_topics()) {
    const auto why = mismatch(offered(topic), requested(topic));
    if (!why.empty()) problems.push_back(profiles.string() + ": nobody will hear " + topic.name + ": " + why);
  }
  return problems;
}

}  // namespace railfix::messaging
