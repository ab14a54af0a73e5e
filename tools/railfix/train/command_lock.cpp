#include "train/command_lock.hpp"

#include <fcntl.h>
#include <poll.h>
#include <sys/file.h>
#include <unistd.h>

#include <ctime>
#include <sstream>

#include "core/time.hpp"
#include "core/whole_file.hpp"

namespace railfix::tool {
namespace {

namespace fs = std::filesystem;

// Long enough for one who has the lock to have signed it, and for one who only looks whether it is free.
constexpr double kPatienceS = 0.3;
constexpr int kTurnMs = 20;

std::string signature_of(const std::string& command) {
  char since[32];
  const std::time_t now = std::time(nullptr);
  std::tm local{};
  localtime_r(&now, &local);
  std::strftime(since, sizeof(since), "%F %T", &local);
  return command + " " + std::to_string(getpid()) + " " + since + "\n";
}

core::BadInput held_by(const fs::path& file, const std::string& does) {
  std::string command;
  std::string pid;
  std::string since;
  if (const auto text = core::read_whole(file); text.ok()) {
    std::istringstream words(text.value());
    words >> command >> pid;
    std::getline(words >> std::ws, since);
  }
  if (since.empty()) return core::BadInput(file.string() + " is held or cannot be written by this user");
  return core::BadInput("railfix train " + command + " (process " + pid + ", since " + since + ") " + does +
                        "; wait until it has ended, or end it with: kill " + pid);
}

}  // namespace

FileLock::FileLock(const fs::path& file, double patience_s) {
  std::error_code failed;
  fs::create_directories(file.parent_path(), failed);
  file_ = open(file.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0644);
  const int64_t deadline_ns = core::monotonic_ns() + core::to_ns(patience_s);
  while (file_ >= 0 && !(held_ = flock(file_, LOCK_EX | LOCK_NB) == 0) && core::monotonic_ns() < deadline_ns)
    poll(nullptr, 0, kTurnMs);
}

FileLock::~FileLock() {
  if (file_ >= 0) close(file_);
}

void FileLock::sign(const std::string& text) const {
  [[maybe_unused]] const bool signed_it =
      ftruncate(file_, 0) == 0 && pwrite(file_, text.data(), text.size(), 0) == static_cast<ssize_t>(text.size());
}

CommandLock::CommandLock(const HostFolder& folder, const std::string& command)
    : lock_(folder.command_lock(), kPatienceS) {
  if (!lock_.is_held())
    throw held_by(folder.command_lock(), "is changing what runs here, and railfix train down works meanwhile");
  lock_.sign(signature_of(command));
  if (!FileLock(folder.down_lock(), kPatienceS).is_held())
    throw held_by(folder.down_lock(), "is stopping what runs here");
}

DownLock::DownLock(const HostFolder& folder) : lock_(folder.down_lock(), kPatienceS) {
  if (!lock_.is_held()) throw held_by(folder.down_lock(), "is stopping what runs here");
  lock_.sign(signature_of("down"));
}

}  // namespace railfix::tool
