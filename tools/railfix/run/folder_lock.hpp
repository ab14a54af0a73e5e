// One run at a time writes into its folder.
#pragma once

#include <filesystem>
#include <memory>

#include "core/result.hpp"

namespace railfix::tool {

class FolderLock {
 public:
  /// Error: another process has it. It lies on the folder itself and goes with the process, so that one that is killed
  /// leaves nothing of it. A file system without locks gives one that holds nobody off.
  static core::Result<std::unique_ptr<FolderLock>> take(const std::filesystem::path& folder);
  ~FolderLock();
  FolderLock(const FolderLock&) = delete;
  FolderLock& operator=(const FolderLock&) = delete;

 private:
  explicit FolderLock(int descriptor) : descriptor_(descriptor) {}
  int descriptor_;
};

}  // namespace railfix::tool
