#include "messaging/shared_memory.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include <filesystem>
#include <sstream>

#include "core/result.hpp"

namespace railfix::messaging {
namespace {

constexpr const char* kFolder = "/dev/shm";

std::string file_of(const eprosima::fastrtps::rtps::GUID_t& endpoint) {
  std::ostringstream file;
  file << kFolder << "/fast_datasharing_" << endpoint.guidPrefix << "_" << endpoint.entityId;
  return file.str();
}

[[noreturn]] void say_that_there_is_none(uint64_t bytes, const std::string& topic) {
  const uint64_t mb = (bytes + 999'999) / 1'000'000;
  throw core::BadInput("topic " + topic + " needs " + std::to_string(mb) + " MB of shared memory: make room in " +
                       kFolder);
}

}  // namespace

bool has_shared_memory(const eprosima::fastrtps::rtps::GUID_t& endpoint) {
  std::error_code none;
  return std::filesystem::exists(file_of(endpoint), none);
}

void expect_shared_memory(uint64_t bytes, const std::string& topic) {
  struct statvfs room {};
  if (statvfs(kFolder, &room) != 0 || room.f_bavail * room.f_frsize < bytes) say_that_there_is_none(bytes, topic);
}

void take_shared_memory(const eprosima::fastrtps::rtps::GUID_t& writer, const std::string& topic) {
  struct stat file {};
  const int open_file = open(file_of(writer).c_str(), O_RDWR | O_CLOEXEC);
  const bool taken = open_file >= 0 && fstat(open_file, &file) == 0 && posix_fallocate(open_file, 0, file.st_size) == 0;
  if (open_file >= 0) close(open_file);
  if (!taken) say_that_there_is_none(static_cast<uint64_t>(file.st_size), topic);
}

}  // namespace railfix::messaging
