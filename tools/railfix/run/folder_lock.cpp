#include "run/folder_lock.hpp"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <cerrno>

#include "core/whole_file.hpp"

namespace railfix::tool {

core::Result<std::unique_ptr<FolderLock>> FolderLock::take(const std::filesystem::path& folder) {
  const int descriptor = open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (descriptor < 0) return core::cannot_read(folder.string());
  std::unique_ptr<FolderLock> lock(new FolderLock(descriptor));
  if (flock(descriptor, LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK) {
    return core::Error{"another railfix run writes into " + folder.string() +
                       " now; wait until it has ended, or give another folder"};
  }
  return lock;
}

FolderLock::~FolderLock() {
  close(descriptor_);
}

}  // namespace railfix::tool
