#include "core/whole_file.hpp"

#include <fcntl.h>
#include <linux/magic.h>
#include <poll.h>
#include <sys/stat.h>
#include <sys/vfs.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <charconv>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <optional>
#include <random>

namespace railfix::core {

namespace {

namespace fs = std::filesystem;

constexpr size_t kMostBytes = 2'000'000'000;  // a device never ends

/// The links in /proc/PID/fd, where /dev/stdout and /dev/fd lead: what is read there is the name that an open file once
/// had, which may be another file's by now, or be none.
bool is_open_file(const fs::path& file) {
  const auto folder = file.has_parent_path() ? file.parent_path() : fs::path(".");
  struct statfs system {};
  return statfs(folder.c_str(), &system) == 0 && system.f_type == PROC_SUPER_MAGIC;
}

/// Where the links at this place lead, whether or not there is something yet. REQUIRES: they lead in no circle.
fs::path place_of(fs::path file) {
  std::error_code failed;
  while (!is_open_file(file) && fs::is_symlink(fs::symlink_status(file, failed)))
    file = file.parent_path() / fs::read_symlink(file, failed);
  return file;
}

std::optional<int> own_descriptor(const fs::path& file) {
  std::error_code failed;
  if (!is_open_file(file) || !fs::equivalent(file.parent_path(), "/proc/self/fd", failed)) return std::nullopt;
  const auto name = file.filename().string();
  int descriptor = -1;
  const auto [end, code] = std::from_chars(name.data(), name.data() + name.size(), descriptor);
  return code == std::errc{} && end == name.data() + name.size() ? std::optional(descriptor) : std::nullopt;
}

/// False: errno is of the first failure.
bool write_and_close(int out, const std::string& bytes) {
  const bool written = write_all(out, std::as_bytes(std::span(bytes)));
  const int reason = errno;
  if (close(out) != 0 && written) return false;
  errno = reason;
  return written;
}

/// Who reads a named pipe may be started in the same line as we: so long it is waited for.
int open_for_reader(const fs::path& file) {
  constexpr int kTries = 50;
  constexpr useconds_t kTryUs = 100'000;
  for (int i = 0;; ++i) {
    const int out = open(file.c_str(), O_WRONLY | O_APPEND | O_NONBLOCK | O_NOCTTY | O_CLOEXEC);
    if (out >= 0 || errno != ENXIO || i == kTries) return out;
    usleep(kTryUs);
  }
}

/// False: errno says why.
bool write_into(const fs::path& file, const std::string& bytes) {
  // Opened once more it would begin at its front and forget that the shell appends.
  if (const auto ours = own_descriptor(file)) {
    const bool in_order = *ours != STDOUT_FILENO || std::fflush(stdout) == 0;
    return in_order && write_all(*ours, std::as_bytes(std::span(bytes)));
  }
  const int out = open_for_reader(file);
  return out >= 0 && write_and_close(out, bytes);
}

/// Its owner as far as we may give files away, and its rights.
void take_after(const struct stat& old, int out) {
  // Of another user's file the group at least, which may be one of ours.
  [[maybe_unused]] const bool given =
      fchown(out, old.st_uid, old.st_gid) == 0 || fchown(out, static_cast<uid_t>(-1), old.st_gid) == 0;
  fchmod(out, old.st_mode & 0777U);
}

/// A new file beside that place; its name is in `draft` and ends in `ending`. Other processes with our number may write
/// there, too: those in other containers.
int open_draft(const fs::path& file, const std::string& ending, mode_t mode, std::string& draft) {
  std::random_device random;
  int out = -1;
  do {
    std::array<char, 16> suffix{};
    std::snprintf(suffix.data(), suffix.size(), ".%08x", random());
    draft = file.string() + suffix.data() + ending;
    out = open(draft.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, mode);
  } while (out < 0 && errno == EEXIST);
  return out;
}

/// The folder takes no other file, or not in this one's place: a single file that is mounted into a container.
bool only_in_place(int reason) {
  return reason == EACCES || reason == EPERM || reason == EROFS || reason == EBUSY;
}

bool rewrite(const fs::path& file, const std::string& bytes) {
  const int out = open(file.c_str(), O_WRONLY | O_TRUNC | O_CLOEXEC);
  return out >= 0 && write_and_close(out, bytes);
}

/// The draft of a file that takes the place of `old`, where that is there. Negative: errno says why.
int draft_for(const fs::path& file, const std::string& ending, const struct stat* old, std::string& draft) {
  const int out = open_draft(file, ending, old != nullptr ? old->st_mode & 0777U : 0666U, draft);
  if (out >= 0 && old != nullptr) take_after(*old, out);
  return out;
}

/// rename() would not mind.
bool nobody_writes(const struct stat* old) {
  constexpr mode_t kSomebodyWrites = 0222;
  if (old == nullptr || (old->st_mode & kSomebodyWrites) != 0) return false;
  errno = EACCES;
  return true;
}

/// False: errno says why. `old` is what is there.
bool replace(const fs::path& file, const struct stat* old, const std::string& bytes) {
  if (nobody_writes(old)) return false;
  std::string draft;
  const int out = draft_for(file, "", old, draft);
  if (out < 0) return old != nullptr && only_in_place(errno) && rewrite(file, bytes);
  if (write_and_close(out, bytes) && rename(draft.c_str(), file.c_str()) == 0) return true;
  const int reason = errno;
  unlink(draft.c_str());
  errno = reason;
  return old != nullptr && only_in_place(reason) && rewrite(file, bytes);
}

const char* remedy(int reason) {
  switch (reason) {
    case ENOENT:
    case ENOTDIR:
      return "does its folder exist?";
    case EACCES:
    case EPERM:
      return "give a place where you may write";
    case ENOSPC:
    case EDQUOT:
      return "make space there";
    case EISDIR:
      return "give the name of a file";
    case ENAMETOOLONG:
      return "give a shorter name";
    case ENXIO:
      return "does anybody read there?";
    default:
      return "give another place";
  }
}

}  // namespace

Error cannot_read(const std::string& name) {
  return {"cannot read " + name + " (" + std::strerror(errno) + "); is the path right?"};
}

Error cannot_write(const std::string& name) {
  const int reason = errno;
  return {"cannot write " + name + " (" + std::strerror(reason) + "); " + remedy(reason)};
}

Result<std::string> read_whole(const std::filesystem::path& file) {
  std::ifstream stream(file, std::ios::binary);
  return stream ? read_whole(stream, file.string()) : cannot_read(file.string());
}

// read() tells of a folder by badbit, where a stream's iterators throw.
Result<std::string> read_whole(std::istream& stream, const std::string& name) {
  std::string text;
  std::array<char, 65536> part{};
  while (stream.read(part.data(), part.size()) || stream.gcount() > 0) {
    text.append(part.data(), static_cast<size_t>(stream.gcount()));
    if (text.size() > kMostBytes) return Error{name + " has more than 2 GB; is it the right file?"};
  }
  if (stream.bad()) return cannot_read(name);
  return text;
}

bool write_all(int descriptor, std::span<const std::byte> bytes) {
  while (!bytes.empty()) {
    const ssize_t count = write(descriptor, bytes.data(), bytes.size());
    if (count > 0) {
      bytes = bytes.subspan(static_cast<size_t>(count));
    } else if (count == 0) {
      errno = EIO;
      return false;
    } else if (errno == EAGAIN) {
      pollfd room{descriptor, POLLOUT, 0};
      poll(&room, 1, -1);
    } else if (errno != EINTR) {
      return false;
    }
  }
  return true;
}

Status write_whole(const std::filesystem::path& file, const std::string& bytes) {
  struct stat old {};
  // The kernel follows the links first: it knows of circles, and refuses another user's link in a folder for everybody.
  const bool there = stat(file.c_str(), &old) == 0;
  if (!there && errno != ENOENT) return cannot_write(file.string());
  if (there && S_ISBLK(old.st_mode)) return Error{"cannot write " + file.string() + ": it is a disk, not a file"};
  const auto place = place_of(file);
  const bool written = is_open_file(place) || (there && !S_ISREG(old.st_mode))
                           ? write_into(place, bytes)
                           : replace(place, there ? &old : nullptr, bytes);
  if (!written) return cannot_write(file.string());
  return {};
}

Status write_whole_with_folders(const std::filesystem::path& file, const std::string& bytes) {
  std::error_code failed;  // write_whole() then says what is missing
  std::filesystem::create_directories(file.parent_path(), failed);
  return write_whole(file, bytes);
}

Result<fs::path> draft_beside(const fs::path& file, const std::string& ending) {
  struct stat old {};
  const bool there = stat(file.c_str(), &old) == 0;
  if (!there && errno != ENOENT) return cannot_write(file.string());
  if (there && !S_ISREG(old.st_mode))
    return Error{"cannot write " + file.string() + ": it is no regular file; give the name of one"};
  const auto* replaced = there ? &old : nullptr;
  std::string draft;
  const int out = nobody_writes(replaced) ? -1 : draft_for(place_of(file), ending, replaced, draft);
  if (out < 0) return cannot_write(file.string());
  close(out);
  return fs::path(draft);
}

Status move_draft(const fs::path& draft, const fs::path& file) {
  if (rename(draft.c_str(), place_of(file).c_str()) != 0) return cannot_write(file.string());
  return {};
}

}  // namespace railfix::core
