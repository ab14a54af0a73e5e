#include "core/whole_file.hpp"

#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <fstream>

namespace railfix::core {

namespace {

Error cannot_read(const std::string& name) {
  return {"cannot read " + name + " (" + std::strerror(errno) + "); is the path right?"};
}

}  // namespace

Result<std::string> read_whole(const std::filesystem::path& file) {
  std::ifstream stream(file, std::ios::binary);
  return stream ? read_whole(stream, file.string()) : cannot_read(file.string());
}

// read() tells of a folder by badbit, where a stream's iterators throw.
Result<std::string> read_whole(std::istream& stream, const std::string& name) {
  std::string text;
  std::array<char, 65536> part{};
  while (stream.read(part.data(), part.size()) || stream.gcount() > 0)
    text.append(part.data(), static_cast<size_t>(stream.gcount()));
  if (stream.bad()) return cannot_read(name);
  return text;
}

bool write_whole(const std::filesystem::path& file, const std::string& bytes) {
  const std::string draft = file.string() + "." + std::to_string(getpid());
  std::ofstream out(draft, std::ios::binary);
  const bool written = out && out.write(bytes.data(), static_cast<std::streamsize>(bytes.size())).flush();
  out.close();
  std::error_code failed;
  if (written) std::filesystem::rename(draft, file, failed);
  if (written && !failed) return true;
  std::filesystem::remove(draft, failed);
  return false;
}

}  // namespace railfix::core
