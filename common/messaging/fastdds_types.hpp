// Private to this folder: the Fast DDS side of a message type.
#pragma once

#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/topic/TypeSupport.hpp>
#include <functional>

#include "messaging/messaging.hpp"

namespace railfix::messaging {

class FastDdsType : public Type {
 public:
  [[nodiscard]] virtual eprosima::fastdds::dds::TypeSupport support() const = 0;
  /// Takes everything that waits in the reader; samples are copied out of the middleware's memory at once, because a
  /// data-sharing writer may reuse it.
  using OnSample = std::function<void(std::shared_ptr<const void>, const SampleInfo&)>;
  virtual void take_all(eprosima::fastdds::dds::DataReader& reader, const OnSample& on_sample) const = 0;
};

/// SampleInfo::writer: half of the participant's prefix and the entity are enough to tell writers apart.
inline uint64_t number_of(const eprosima::fastrtps::rtps::GUID_t& writer) {
  uint64_t number = 0;
  for (size_t i = 4; i < 12; ++i) number = number * 31 + writer.guidPrefix.value[i];
  for (size_t i = 0; i < 4; ++i) number = number * 257 + writer.entityId.value[i];
  return number;
}

inline const FastDdsType& fastdds(const Type& type) {
  return static_cast<const FastDdsType&>(type);
}

}  // namespace railfix::messaging
