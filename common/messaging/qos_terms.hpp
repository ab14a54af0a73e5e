// Private to this folder: what of a quality of service decides whether a writer and a reader match (DDS 1.4, 2.2.3).
#pragma once

#include <cstdint>
#include <fastdds/dds/subscriber/qos/DataReaderQos.hpp>
#include <string>

namespace railfix::messaging {

struct Terms {
  bool reliable = false;
  bool transient_local = false;
  bool exclusive = false;
  int64_t deadline_ns = 0;
  int64_t lease_ns = 0;
  int liveliness = 0;
};

/// Of a discovered endpoint, or of a profile.
template <class Qos>
Terms terms_of(const Qos& qos) {
  namespace dds = eprosima::fastdds::dds;
  return {qos.m_reliability.kind == dds::RELIABLE_RELIABILITY_QOS,
          qos.m_durability.kind >= dds::TRANSIENT_LOCAL_DURABILITY_QOS,
          qos.m_ownership.kind == dds::EXCLUSIVE_OWNERSHIP_QOS,
          qos.m_deadline.period.to_ns(),
          qos.m_liveliness.lease_duration.to_ns(),
          static_cast<int>(qos.m_liveliness.kind)};
}
inline Terms terms_of(const eprosima::fastdds::dds::DataReaderQos& qos) {
  namespace dds = eprosima::fastdds::dds;
  return {qos.reliability().kind == dds::RELIABLE_RELIABILITY_QOS,
          qos.durability().kind >= dds::TRANSIENT_LOCAL_DURABILITY_QOS,
          qos.ownership().kind == dds::EXCLUSIVE_OWNERSHIP_QOS,
          qos.deadline().period.to_ns(),
          qos.liveliness().lease_duration.to_ns(),
          static_cast<int>(qos.liveliness().kind)};
}

/// Why this reader does not hear this writer; empty = it does.
std::string mismatch(const Terms& writer, const Terms& reader);

}  // namespace railfix::messaging
