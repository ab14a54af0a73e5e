// Private to this folder: the files in /dev/shm through which Fast DDS shares pictures. 2.9.1 makes them without asking
// for room: who then writes there is ended by the kernel (SIGBUS).
#pragma once

#include <fastdds/rtps/common/Guid.h>

#include <cstdint>
#include <string>

namespace railfix::messaging {

/// Whether this reader or writer of this host has its file.
[[nodiscard]] bool has_shared_memory(const eprosima::fastrtps::rtps::GUID_t& endpoint);
/// Throws BadInput when there is no room for so much more.
void expect_shared_memory(uint64_t bytes, const std::string& topic);
/// All room of its file is its own from now on. Throws BadInput when there is none, or no file.
void take_shared_memory(const eprosima::fastrtps::rtps::GUID_t& writer, const std::string& topic);

}  // namespace railfix::messaging
