#include "train/command_lock.hpp"

#include <unistd.h>

#include <ctime>
#include <sstream>

#include "core/whole_file.hpp"

namespace railfix::tool {
namespace {

namespace fs = std::filesystem;

// Long enough for one who has the lock to have signed it, and for one who only looks whether it is free.
constexpr double kPatienceS = 0.3;

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
