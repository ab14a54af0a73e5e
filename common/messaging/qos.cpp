#include <sstream>
#include <type_traits>

#include "core/time.hpp"
#include "messaging/fastdds_qos.hpp"
#include "messaging/topics.hpp"

namespace railfix::messaging {
namespace {

namespace dds = eprosima::fastdds::dds;

eprosima::fastrtps::Duration_t duration(int64_t ns) {
  return {static_cast<int32_t>(ns / core::kNsPerSecond), static_cast<uint32_t>(ns % core::kNsPerSecond)};
}

// What the cable has lost is asked for again at the writer's next heartbeat; Fast DDS's own come every 3 s. Each costs
// every reader two messages, so only what position and reports hang on is asked for much sooner, and what everybody
// says of himself so that he is not called silent for long behind a short interruption. 0 = Fast DDS's own.
int64_t heartbeat_ns(const QosProfile& profile) {
  if (!profile.writer_reliable) return 0;
  if (profile.exclusive || (profile.transient_local && profile.max_instances == 1)) return 200'000'000;
  return profile.transient_local ? core::kNsPerSecond : 0;
}

// A volatile writer forgets what nobody waits for any more, and in 2.9.1 it waits for ever where a reader leaves while
// that is just being sent (eProsima/Fast-DDS#3468). One that keeps its history does not, and readers that ask for
// nothing old get nothing old. Shared memory is not sent, and would stay full.
bool keeps_history(const QosProfile& profile, bool writer) {
  return profile.transient_local || (writer && profile.writer_reliable && !profile.data_sharing);
}

template <class Qos>
void apply_common(const QosProfile& profile, Qos& qos) {
  constexpr bool kWriter = std::is_same_v<Qos, dds::DataWriterQos>;
  qos.durability().kind =
      keeps_history(profile, kWriter) ? dds::TRANSIENT_LOCAL_DURABILITY_QOS : dds::VOLATILE_DURABILITY_QOS;
  qos.history().kind = dds::KEEP_LAST_HISTORY_QOS;
  qos.history().depth = profile.depth;
  qos.resource_limits().max_instances = profile.max_instances;
  qos.resource_limits().max_samples_per_instance = profile.depth;
  qos.resource_limits().max_samples = profile.depth * profile.max_instances;
  qos.resource_limits().allocated_samples = std::min(profile.depth * profile.max_instances, 16);
  if (profile.deadline_ns > 0) qos.deadline().period = duration(profile.deadline_ns);
  if (profile.data_sharing) {
    qos.data_sharing().automatic();
  } else {
    qos.data_sharing().off();
  }
  qos.endpoint().history_memory_policy = profile.data_sharing
                                             ? eprosima::fastrtps::rtps::PREALLOCATED_MEMORY_MODE
                                             : eprosima::fastrtps::rtps::PREALLOCATED_WITH_REALLOC_MEMORY_MODE;
}

std::string xml_duration(int64_t ns) {
  std::ostringstream xml;
  xml << "<sec>" << ns / core::kNsPerSecond << "</sec><nanosec>" << ns % core::kNsPerSecond << "</nanosec>";
  return xml.str();
}

void write_xml(std::ostream& xml, const TopicInfo& topic, bool writer) {
  const QosProfile& p = topic.qos;
  const char* tag = writer ? "data_writer" : "data_reader";
  const bool reliable = writer ? p.writer_reliable : p.reliable;
  xml << "    <" << tag << " profile_name=\"" << topic.name << "\">\n      <qos>\n";
  if (p.data_sharing) {
    xml << "        <data_sharing><kind>AUTOMATIC</kind></data_sharing>\n";
  } else {
    xml << "        <data_sharing><kind>OFF</kind></data_sharing>\n";
  }
  xml << "        <reliability><kind>" << (reliable ? "RELIABLE" : "BEST_EFFORT") << "</kind></reliability>\n";
  xml << "        <durability><kind>" << (keeps_history(p, writer) ? "TRANSIENT_LOCAL" : "VOLATILE")
      << "</kind></durability>\n";
  if (p.deadline_ns > 0) xml << "        <deadline><period>" << xml_duration(p.deadline_ns) << "</period></deadline>\n";
  if (writer)
    xml << "        <publishMode><kind>" << (p.asynchronous ? "ASYNCHRONOUS" : "SYNCHRONOUS")
        << "</kind></publishMode>\n";
  xml << "      </qos>\n      <topic>\n";
  xml << "        <historyQos><kind>KEEP_LAST</kind><depth>" << p.depth << "</depth></historyQos>\n";
  xml << "        <resourceLimitsQos><max_samples>" << p.depth * p.max_instances << "</max_samples><max_instances>"
      << p.max_instances << "</max_instances><max_samples_per_instance>" << p.depth
      << "</max_samples_per_instance><allocated_samples>" << std::min(p.depth * p.max_instances, 16)
      << "</allocated_samples></resourceLimitsQos>\n      </topic>\n";
  if (const int64_t period_ns = writer ? heartbeat_ns(p) : 0; period_ns > 0)
    xml << "      <times><heartbeatPeriod>" << xml_duration(period_ns) << "</heartbeatPeriod></times>\n";
  xml << "      <historyMemoryPolicy>" << (p.data_sharing ? "PREALLOCATED" : "PREALLOCATED_WITH_REALLOC")
      << "</historyMemoryPolicy>\n    </" << tag << ">\n";
}

}  // namespace

void apply(const QosProfile& profile, dds::DataWriterQos& qos) {
  apply_common(profile, qos);
  qos.reliability().kind = profile.writer_reliable ? dds::RELIABLE_RELIABILITY_QOS : dds::BEST_EFFORT_RELIABILITY_QOS;
  qos.publish_mode().kind = profile.asynchronous ? dds::ASYNCHRONOUS_PUBLISH_MODE : dds::SYNCHRONOUS_PUBLISH_MODE;
  if (const int64_t period_ns = heartbeat_ns(profile); period_ns > 0)
    qos.reliable_writer_qos().times.heartbeatPeriod = duration(period_ns);
}

void apply(const QosProfile& profile, dds::DataReaderQos& qos) {
  apply_common(profile, qos);
  qos.reliability().kind = profile.reliable ? dds::RELIABLE_RELIABILITY_QOS : dds::BEST_EFFORT_RELIABILITY_QOS;
}

std::string qos_xml() {
  std::ostringstream xml;
  xml << "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n"
         "<!-- Quality of service of every Railfix topic, one writer and one reader profile each. Equal to the "
         "compiled-in\n"
         "     profiles (common/messaging/topics.hpp; `railfix topics qos` prints this file). Services use an edited "
         "copy with\n"
         "     common.qos_profiles. -->\n"
         "<dds xmlns=\"http://www.eprosima.com/XMLSchemas/fastRTPS_Profiles\">\n  <profiles>\n";
  for (const auto& topic : all_topics()) {
    write_xml(xml, topic, true);
    write_xml(xml, topic, false);
  }
  xml << "  </profiles>\n</dds>\n";
  return xml.str();
}

}  // namespace railfix::messaging
