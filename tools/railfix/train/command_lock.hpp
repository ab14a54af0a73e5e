// Keeps commands apart that are typed at the same time and change what runs on a computer.
#pragma once

#include <filesystem>
#include <string>

#include "train/plan.hpp"

namespace railfix::tool {

/// A lock on a file, which a process that dies cannot leave behind.
class FileLock {
 public:
  /// Tries for so long. Makes the file and its folder when they are not there.
  FileLock(const std::filesystem::path& file, double patience_s);
  ~FileLock();
  FileLock(const FileLock&) = delete;
  FileLock& operator=(const FileLock&) = delete;
  [[nodiscard]] bool is_held() const { return held_; }
  /// In place of what the file holds: who it is.
  void sign(const std::string& text) const;

 private:
  int file_ = -1;
  bool held_ = false;
};

/// Of `up`, `upgrade` and `rollback` one at a time may be at work, and none begins while `down` is at work.
class CommandLock {
 public:
  /// Throws BadInput: another one has it, which, since when, and what to do.
  CommandLock(const HostFolder& folder, const std::string& command);

 private:
  FileLock lock_;
};

/// `down` is kept apart from other `down`s only: it has to work while an upgrade waits, which then stops by itself.
class DownLock {
 public:
  /// Throws BadInput like the above.
  explicit DownLock(const HostFolder& folder);

 private:
  FileLock lock_;
};

}  // namespace railfix::tool
