#include "messaging/shared_memory.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include <cerrno>
#include <sstream>

namespace railfix::messaging {
namespace {

constexpr const char* kFolder = "/dev/shm";

std::string file_of(const eprosima::fastrtps::rtps::GUID_t& endpoint) {
  std::ostringstream file;
  file << kFolder << "/fast_datasharing_" << endpoint.guidPrefix << "_" << endpoint.entityId;
  return file.str();
}

[[noreturn]] void throw_no_room(uint64_t bytes, const std::string& topic) {
  const uint64_t mb = (bytes + 999'999) / 1'000'000;
  throw NoRoom("topic " + topic + " needs " + std::to_string(mb) + " MB of shared memory: make room in " + kFolder);
}

// A signal may come meanwhile.
bool take_all(int open_file, off_t bytes) {
  int error = 0;
  do error = posix_fallocate(open_file, 0, bytes);
  while (error == EINTR);
  return error == 0;
}

}  // namespace

bool wants_shared_memory(const TopicInfo& topic, const eprosima::fastdds::dds::DataSharingQosPolicy& profile) {
  const bool wants = topic.qos.data_sharing && profile.kind() != eprosima::fastdds::dds::DataSharingKind::OFF;
  if (wants && !profile.shm_directory().empty()) {
    throw core::BadInput("the profile of topic " + topic.name + " has the shared_dir " + profile.shm_directory() +
                         "; pictures are shared in " + kFolder + ": take shared_dir out");
  }
  return wants;
}

// Another user's files can be read by everybody, and a reader is called by writing to its file.
bool has_shared_memory(const eprosima::fastrtps::rtps::GUID_t& endpoint) {
  return eaccess(file_of(endpoint).c_str(), R_OK | W_OK) == 0;
}

void expect_shared_memory(uint64_t bytes, const std::string& topic) {
  struct statvfs room {};
  if (statvfs(kFolder, &room) != 0 || room.f_bavail * room.f_frsize < bytes) throw_no_room(bytes, topic);
}

void take_shared_memory(const eprosima::fastrtps::rtps::GUID_t& writer, const std::string& topic) {
  struct stat file {};
  const int open_file = open(file_of(writer).c_str(), O_RDWR | O_CLOEXEC);
  const bool taken = open_file >= 0 && fstat(open_file, &file) == 0 && take_all(open_file, file.st_size);
  if (open_file >= 0) close(open_file);
  if (!taken) throw_no_room(static_cast<uint64_t>(file.st_size), topic);
}

}  // namespace railfix::messaging
