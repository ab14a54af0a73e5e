#include "train/stands_still.hpp"

#include <sys/stat.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>

namespace railfix::tool {
namespace {

// Of /proc/PID/stat.
constexpr int kStateField = 3;
constexpr int kParentField = 4;
constexpr int kStartTimeField = 22;

// `proc` is a process's or a thread's folder there.
std::string field_of(const std::filesystem::path& proc, int number) {
  std::string line;
  std::getline(std::ifstream(proc / "stat"), line);
  const size_t name_end = line.rfind(')');  // the name may hold anything
  if (name_end == std::string::npos) return "";
  std::istringstream fields(line.substr(name_end + 1));
  std::string field;
  for (int at = kStateField; at <= number; ++at) fields >> field;
  return field;
}

std::filesystem::path proc_of(pid_t pid) {
  return "/proc/" + std::to_string(pid);
}

}  // namespace

std::vector<pid_t> processes() {
  std::vector<pid_t> pids;
  std::error_code gone;
  for (const auto& entry : std::filesystem::directory_iterator("/proc", gone)) {
    const auto pid = static_cast<pid_t>(std::atoll(entry.path().filename().c_str()));
    if (pid > 0) pids.push_back(pid);
  }
  return pids;
}

bool stands_still(pid_t pid) {
  std::error_code gone;
  bool any = false;
  for (const auto& thread : std::filesystem::directory_iterator(proc_of(pid) / "task", gone)) {
    const auto state = field_of(thread.path(), kStateField);
    if (state.empty()) continue;
    if (state == "R" || state == "D") return false;
    any = true;
  }
  return any;
}

pid_t holder_of(const std::filesystem::path& file) {
  struct stat wanted {};
  if (stat(file.c_str(), &wanted) != 0) return 0;
  for (const pid_t pid : processes()) {
    std::error_code gone;
    for (const auto& open : std::filesystem::directory_iterator(proc_of(pid) / "fd", gone)) {
      struct stat held {};
      if (stat(open.path().c_str(), &held) == 0 && held.st_dev == wanted.st_dev && held.st_ino == wanted.st_ino)
        return pid;
    }
  }
  return 0;
}

int64_t born_of(pid_t pid) {
  const auto state = field_of(proc_of(pid), kStateField);
  if (state.empty() || state == "Z" || state == "X") return 0;
  return std::atoll(field_of(proc_of(pid), kStartTimeField).c_str());
}

pid_t parent_of(pid_t pid) {
  return static_cast<pid_t>(std::atoll(field_of(proc_of(pid), kParentField).c_str()));
}

std::vector<std::string> command_of(pid_t pid) {
  std::ifstream file(proc_of(pid) / "cmdline", std::ios::binary);
  std::vector<std::string> command;
  for (std::string argument; std::getline(file, argument, '\0');) command.push_back(argument);
  return command;
}

}  // namespace railfix::tool
