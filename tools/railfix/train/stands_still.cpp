#include "train/stands_still.hpp"

#include <filesystem>
#include <fstream>
#include <string>

namespace railfix::tool {

bool stands_still(pid_t pid) {
  std::error_code gone;
  bool any = false;
  for (const auto& thread : std::filesystem::directory_iterator("/proc/" + std::to_string(pid) + "/task", gone)) {
    std::string line;
    std::getline(std::ifstream(thread.path() / "stat"), line);
    const size_t name_end = line.rfind(')');  // the name may hold anything
    if (name_end == std::string::npos || name_end + 2 >= line.size()) continue;
    const char state = line[name_end + 2];
    if (state == 'R' || state == 'D') return false;
    any = true;
  }
  return any;
}

}  // namespace railfix::tool
