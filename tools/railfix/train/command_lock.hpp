// Keeps commands apart that are typed at the same time and change what runs on a computer.
#pragma once

#include <string>

#include "train/file_lock.hpp"
#include "train/plan.hpp"

namespace railfix::tool {

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
