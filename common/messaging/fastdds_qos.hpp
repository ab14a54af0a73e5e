// Private to this folder: our profile as Fast DDS quality of service.
#pragma once

#include <fastdds/dds/publisher/qos/DataWriterQos.hpp>
#include <fastdds/dds/subscriber/qos/DataReaderQos.hpp>

#include "messaging/qos.hpp"

namespace railfix::messaging {

void apply(const QosProfile& profile, eprosima::fastdds::dds::DataWriterQos& qos);
void apply(const QosProfile& profile, eprosima::fastdds::dds::DataReaderQos& qos);

}  // namespace railfix::messaging
