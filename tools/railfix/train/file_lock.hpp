// Keeps processes of one computer apart.
#pragma once

#include <filesystem>
#include <string>

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
  /// In place of what the file holds: who it is. False: errno says why not.
  bool sign(const std::string& text) const;

 private:
  int file_ = -1;
  bool held_ = false;
};

}  // namespace railfix::tool
