#include "train/log_file.hpp"

#include <fcntl.h>

namespace railfix::tool {

int open_log(const std::filesystem::path& file) {
  constexpr uintmax_t kLongBytes = 20'000'000;
  std::error_code failed;
  std::filesystem::create_directories(file.parent_path(), failed);
  const auto bytes = std::filesystem::file_size(file, failed);
  if (!failed && bytes > kLongBytes) std::filesystem::rename(file, file.string() + ".1", failed);
  return open(file.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0644);
}

}  // namespace railfix::tool
