#include "train/file_lock.hpp"

#include <fcntl.h>
#include <poll.h>
#include <sys/file.h>
#include <unistd.h>

#include "core/time.hpp"

namespace railfix::tool {
namespace {

namespace fs = std::filesystem;

constexpr int kTurnMs = 20;

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

bool FileLock::sign(const std::string& text) const {
  return ftruncate(file_, 0) == 0 && pwrite(file_, text.data(), text.size(), 0) == static_cast<ssize_t>(text.size());
}

}  // namespace railfix::tool
