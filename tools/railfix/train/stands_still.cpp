#include "train/stands_still.hpp"

#include <sys/stat.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>

namespace railfix::tool {
namespace {

constexpr int kStartTimeField = 22;  // of /proc/PID/stat

}  // namespace

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

pid_t holder_of(const std::filesystem::path& file) {
  struct stat wanted {};
  if (stat(file.c_str(), &wanted) != 0) return 0;
  std::error_code gone;
  for (const auto& process : std::filesystem::directory_iterator("/proc", gone)) {
    const auto pid = static_cast<pid_t>(std::atoll(process.path().filename().c_str()));
    if (pid <= 0) continue;
    for (const auto& open : std::filesystem::directory_iterator(process.path() / "fd", gone)) {
      struct stat held {};
      if (stat(open.path().c_str(), &held) == 0 && held.st_dev == wanted.st_dev && held.st_ino == wanted.st_ino)
        return pid;
    }
  }
  return 0;
}

int64_t born_of(pid_t pid) {
  std::string line;
  std::getline(std::ifstream("/proc/" + std::to_string(pid) + "/stat"), line);
  const size_t name_end = line.rfind(')');
  if (name_end == std::string::npos) return 0;
  std::istringstream fields(line.substr(name_end + 1));
  std::string field;
  fields >> field;  // state, field 3
  if (field == "Z" || field == "X") return 0;
  for (int number = 4; number <= kStartTimeField; ++number) fields >> field;
  return std::atoll(field.c_str());
}

std::vector<std::string> command_of(pid_t pid) {
  std::ifstream file("/proc/" + std::to_string(pid) + "/cmdline", std::ios::binary);
  std::vector<std::string> command;
  for (std::string argument; std::getline(file, argument, '\0');) command.push_back(argument);
  return command;
}

}  // namespace railfix::tool
