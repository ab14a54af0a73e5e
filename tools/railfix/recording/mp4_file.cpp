#include "recording/mp4_file.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <fstream>
#include <span>
#include <vector>

#include "core/whole_file.hpp"

namespace railfix::tool {

namespace {

constexpr size_t kHeadBytes = 8;
constexpr size_t kLongHeadBytes = 16;

uint64_t big_endian(std::span<const char> bytes) {
  uint64_t value = 0;
  for (const char one : bytes) value = value << 8U | static_cast<uint8_t>(one);
  return value;
}

/// Its boxes fill it to the byte, and the index is one of them.
bool is_whole(const std::filesystem::path& film) {
  std::ifstream stream(film, std::ios::binary | std::ios::ate);
  const auto size = static_cast<uint64_t>(std::max<std::streamoff>(stream.tellg(), 0));
  bool indexed = false;
  uint64_t offset = 0;
  while (offset < size && size - offset >= kHeadBytes) {
    std::array<char, kLongHeadBytes> head{};
    stream.seekg(static_cast<std::streamoff>(offset));
    stream.read(head.data(), static_cast<std::streamsize>(std::min<uint64_t>(head.size(), size - offset)));
    if (!stream) return false;
    uint64_t length = big_endian(std::span(head).first(4));
    if (length == 1) length = big_endian(std::span(head).last(kHeadBytes));
    if (length < kHeadBytes || length > size - offset) return false;
    indexed = indexed || std::string_view(head.data() + 4, 4) == "moov";
    offset += length;
  }
  return indexed && offset == size;
}

}  // namespace

core::Status takes_more(const std::filesystem::path& film, const std::string& name) {
  const std::vector<std::byte> block(size_t{1} << 16U);
  const int out =
      open(film.c_str(), O_WRONLY | O_APPEND | O_CREAT | O_CLOEXEC, 0666);  // OpenCV removes what it cannot begin
  core::Status status;
  if (out < 0 || !core::write_all(out, block)) status = core::cannot_write(name + " to its end");
  if (out >= 0) close(out);
  return status;
}

core::Status whole_mp4(const std::filesystem::path& film, const std::string& name) {
  if (is_whole(film)) return {};
  auto status = takes_more(film, name);
  if (!status.ok()) return status;
  errno = EIO;  // there is room again
  return core::cannot_write(name + " to its end");
}

}  // namespace railfix::tool
