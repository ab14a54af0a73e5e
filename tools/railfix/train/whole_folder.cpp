#include "train/whole_folder.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>

namespace railfix::tool {
namespace {

namespace fs = std::filesystem;

fs::path place_of(const fs::path& folder) {
  std::error_code none;
  const auto place = fs::canonical(folder, none);
  return none ? folder : place;
}

/// Hidden, so that nobody takes it for one of the folders there.
fs::path beside(const fs::path& place, const char* what) {
  return place.parent_path() / ("." + place.filename().string() + "." + what);
}

core::Error failed_at(const fs::path& place, const std::string& why) {
  return {place.string() + " cannot be replaced (" + why +
          "); it must be a folder of its own, where you may write, and no place where a disk is mounted"};
}

// As far as we may give files away.
void take_after(const fs::path& original, const fs::path& copy) {
  struct stat old {};
  if (lstat(original.c_str(), &old) != 0) return;
  [[maybe_unused]] const bool given = lchown(copy.c_str(), old.st_uid, old.st_gid) == 0;
  if (!S_ISLNK(old.st_mode)) chmod(copy.c_str(), old.st_mode & 07777U);
}

core::Status copy_whole(const fs::path& from, const fs::path& to) {
  std::error_code failed;
  fs::copy(from, to, fs::copy_options::recursive | fs::copy_options::copy_symlinks, failed);
  if (failed) return core::Error{from.string() + " cannot be copied to " + to.string() + ": " + failed.message()};
  take_after(from, to);
  for (const auto& entry : fs::recursive_directory_iterator(from))
    take_after(entry.path(), to / entry.path().lexically_relative(from));
  return {};
}

bool move(const fs::path& from, const fs::path& to, unsigned flags = 0) {
  return renameat2(AT_FDCWD, from.c_str(), AT_FDCWD, to.c_str(), flags) == 0;
}

}  // namespace

core::Result<fs::path> draft_of_folder(const fs::path& folder) {
  const auto place = place_of(folder);
  const auto draft = beside(place, "draft");
  const auto before = beside(place, "before");
  std::error_code failed;
  if (!fs::exists(place) && fs::exists(before)) fs::rename(before, place, failed);
  for (const auto& left : {draft, before}) fs::remove_all(left, failed);
  if (fs::exists(place)) {
    if (const auto copied = copy_whole(place, draft); !copied.ok()) return copied.error();
  } else if (!fs::create_directories(draft, failed)) {
    return core::Error{draft.string() + " cannot be made: " + failed.message()};
  }
  return draft;
}

core::Status replace_folder(const fs::path& draft, const fs::path& folder) {
  const auto place = place_of(folder);
  const auto before = beside(place, "before");
  to_disk(draft);
  bool done = false;
  if (!fs::exists(place)) {
    done = move(draft, place);
  } else if (move(draft, place, RENAME_EXCHANGE)) {
    done = true;
  } else if (errno == EINVAL || errno == ENOSYS) {
    done = move(place, before) && move(draft, place);
  }
  if (!done) return failed_at(place, std::strerror(errno));
  to_disk(place);
  std::error_code failed;
  for (const auto& left : {draft, before}) fs::remove_all(left, failed);
  return {};
}

void to_disk(const fs::path& folder) {
  const int opened = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (opened < 0) return;
  static_cast<void>(::syncfs(opened));
  ::close(opened);
}

}  // namespace railfix::tool
