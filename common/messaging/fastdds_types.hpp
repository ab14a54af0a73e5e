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

inline const FastDdsType& fastdds(const Type& type) {
  return static_cast<const FastDdsType&>(type);
}

}  // namespace railfix::messaging
