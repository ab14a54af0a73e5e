// deploy/qos/railfix_qos.xml says the same as the compiled-in profiles, to people and to Fast DDS.
#include <gtest/gtest.h>

#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fstream>
#include <sstream>

#include "messaging/fastdds_qos.hpp"
#include "messaging/topics.hpp"

namespace railfix::messaging {
namespace {

namespace dds = eprosima::fastdds::dds;
const std::string kXml = std::string(RAILFIX_SOURCE_DIR) + "/deploy/qos/railfix_qos.xml";

TEST(QosFile, IsTheCompiledInText) {
  std::stringstream text;
  text << std::ifstream(kXml).rdbuf();
  EXPECT_EQ(text.str(), qos_xml()) << "write it anew: railfix topics qos > deploy/qos/railfix_qos.xml";
}

template <class Qos>
void expect_equal(const Qos& xml, const Qos& compiled, const std::string& topic) {
  EXPECT_TRUE(xml.durability() == compiled.durability()) << topic;
  EXPECT_TRUE(xml.reliability().kind == compiled.reliability().kind) << topic;
  EXPECT_TRUE(xml.history() == compiled.history()) << topic;
  EXPECT_TRUE(xml.resource_limits() == compiled.resource_limits()) << topic;
  EXPECT_TRUE(xml.ownership() == compiled.ownership()) << topic;
  EXPECT_TRUE(xml.deadline() == compiled.deadline()) << topic;
  EXPECT_TRUE(xml.liveliness() == compiled.liveliness()) << topic;
  EXPECT_EQ(xml.data_sharing().kind(), compiled.data_sharing().kind()) << topic;
  EXPECT_EQ(xml.endpoint().history_memory_policy, compiled.endpoint().history_memory_policy) << topic;
}

TEST(QosFile, MeansTheSameToFastDds) {
  auto* factory = dds::DomainParticipantFactory::get_instance();
  ASSERT_EQ(factory->load_XML_profiles_file(kXml), ReturnCode_t::RETCODE_OK);
  auto* participant = factory->create_participant(77, dds::PARTICIPANT_QOS_DEFAULT);
  ASSERT_NE(participant, nullptr);
  auto* publisher = participant->create_publisher(dds::PUBLISHER_QOS_DEFAULT);
  auto* subscriber = participant->create_subscriber(dds::SUBSCRIBER_QOS_DEFAULT);
  for (const auto& topic : all_topics()) {
    dds::DataWriterQos writer_xml;
    dds::DataWriterQos writer;
    ASSERT_EQ(publisher->get_datawriter_qos_from_profile(topic.name, writer_xml), ReturnCode_t::RETCODE_OK)
        << topic.name;
    apply(topic.qos, writer);
    expect_equal(writer_xml, writer, topic.name);
    EXPECT_EQ(writer_xml.publish_mode().kind, writer.publish_mode().kind) << topic.name;
    EXPECT_TRUE(writer_xml.reliable_writer_qos().times.heartbeatPeriod ==
                writer.reliable_writer_qos().times.heartbeatPeriod)
        << topic.name;
    dds::DataReaderQos reader_xml;
    dds::DataReaderQos reader;
    ASSERT_EQ(subscriber->get_datareader_qos_from_profile(topic.name, reader_xml), ReturnCode_t::RETCODE_OK)
        << topic.name;
    apply(topic.qos, reader);
    expect_equal(reader_xml, reader, topic.name);
  }
  participant->delete_contained_entities();
  factory->delete_participant(participant);
}

}  // namespace
}  // namespace railfix::messaging
