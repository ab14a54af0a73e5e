// Private to this folder: the files in /dev/shm through which Fast DDS shares pictures. 2.9.1 makes them without asking
// for room: who then writes there is ended by the kernel (SIGBUS).
#pragma once

#include <fastdds/rtps/common/Guid.h>

#include <cstdint>
#include <fastdds/dds/core/policy/QosPolicies.hpp>
#include <string>

#include "messaging/messaging.hpp"

namespace railfix::messaging {

/// Whether the topic's samples are to be shared in memory. Throws BadInput where a profile names another folder for it:
/// the others look in /dev/shm.
[[nodiscard]] bool wants_shared_memory(const TopicInfo& topic,
                                       const eprosima::fastdds::dds::DataSharingQosPolicy& profile);
/// Whether this reader or writer of this host has a file that this process may read and write.
[[nodiscard]] bool has_shared_memory(const eprosima::fastrtps::rtps::GUID_t& endpoint);
/// Looks for room, and takes none. Throws NoRoom when there is less.
void expect_shared_memory(uint64_t bytes, const std::string& topic);
/// All room of its file is its own from now on. Throws NoRoom when there is none. REQUIRES: it has its file.
void take_shared_memory(const eprosima::fastrtps::rtps::GUID_t& writer, const std::string& topic);

}  // namespace railfix::messaging
