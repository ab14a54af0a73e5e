#include "core/whole_file.hpp"

#include <unistd.h>

#include <fstream>

namespace railfix::core {

bool write_whole(const std::filesystem::path& file, const std::string& bytes) {
  const std::string draft = file.string() + "." + std::to_string(getpid());
  std::ofstream out(draft, std::ios::binary);
  const bool written = out && out.write(bytes.data(), static_cast<std::streamsize>(bytes.size())).flush();
  out.close();
  std::error_code failed;
  if (written) std::filesystem::rename(draft, file, failed);
  if (written && !failed) return true;
  std::filesystem::remove(draft, failed);
  return false;
}

}  // namespace railfix::core
