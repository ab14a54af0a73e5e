#include "messaging/qos_match.hpp"

#include <fastrtps/xmlparser/XMLProfileManager.h>

#include "messaging/fastdds_qos.hpp"
#include "messaging/qos_terms.hpp"
#include "messaging/topics.hpp"

namespace railfix::messaging {
namespace {

namespace dds = eprosima::fastdds::dds;
using Profiles = eprosima::fastrtps::xmlparser::XMLProfileManager;

Terms built_in(const TopicInfo& topic, bool writer) {
  dds::DataReaderQos qos;
  apply(topic.qos, qos);
  Terms terms = terms_of(qos);
  terms.reliable = writer ? topic.qos.writer_reliable : topic.qos.reliable;
  return terms;
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

}  // namespace

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
