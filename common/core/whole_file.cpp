#include "core/whole_file.hpp"

#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <optional>

namespace railfix::core {

namespace {

/// Where the links at this place lead, whether or not there is something yet; nothing where no file may be put.
std::optional<std::filesystem::path> place_of(std::filesystem::path file) {
  namespace fs = std::filesystem;
  // The kernel follows the links first: it knows of circles, and refuses another user's link in a folder for everybody.
  std::error_code failed;
  const auto there = fs::status(file, failed).type();
  if (there != fs::file_type::not_found && there != fs::file_type::regular) return std::nullopt;
  while (fs::is_symlink(fs::symlink_status(file, failed))) {
    const auto target = fs::read_symlink(file, failed);
    if (failed) return std::nullopt;
    file = file.parent_path() / target;
  }
  return file;
}

}  // namespace

Error cannot_read(const std::string& name) {
  return {"cannot read " + name + " (" + std::strerror(errno) + "); is the path right?"};
}

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
  const auto place = place_of(file);
  if (!place) return false;
  const std::string draft = place->string() + "." + std::to_string(getpid());
  std::ofstream out(draft, std::ios::binary);
  const bool written = out && out.write(bytes.data(), static_cast<std::streamsize>(bytes.size())).flush();
  out.close();
  std::error_code failed;
  if (written) std::filesystem::rename(draft, *place, failed);
  if (written && !failed) return true;
  std::filesystem::remove(draft, failed);
  return false;
}

}  // namespace railfix::core
