#include "run/processes.hpp"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cstring>
#include <deque>
#include <fstream>
#include <ranges>

#include "core/time.hpp"
#include "core/whole_file.hpp"
#include "service/service.hpp"
#include "train/containers.hpp"

namespace railfix::tool {
namespace {

constexpr size_t kTailLines = 5;
constexpr int kPollMs = 20;
constexpr double kRecorderS = 15;

std::string describe(int wait_status) {
  if (WIFSIGNALED(wait_status))
    return "was ended by signal " + std::to_string(WTERMSIG(wait_status)) + " (" + strsignal(WTERMSIG(wait_status)) +
           ")";
  return "ended with exit code " + std::to_string(WEXITSTATUS(wait_status));
}

[[noreturn]] void become(const std::filesystem::path& program, const std::vector<std::string>& arguments, int log) {
  prctl(PR_SET_PDEATHSIG, SIGTERM);  // services never outlive the run
  setpgid(0, 0);                     // Ctrl-C reaches the run alone, which then stops services in order
  dup2(log, STDOUT_FILENO);
  dup2(log, STDERR_FILENO);
  close_range(STDERR_FILENO + 1, ~0U, CLOSE_RANGE_CLOEXEC);  // DDS's sockets stay with the run
  std::vector<char*> argv{const_cast<char*>(program.c_str())};
  for (const auto& argument : arguments) argv.push_back(const_cast<char*>(argument.c_str()));
  argv.push_back(nullptr);
  execv(program.c_str(), argv.data());
  _exit(127);
}

}  // namespace

core::Result<std::vector<ServiceProgram>> find_service_programs() {
  const auto folder = std::filesystem::read_symlink("/proc/self/exe").parent_path();
  std::vector<ServiceProgram> programs;
  // Against the way of the data: who listens is there before who speaks.
  for (const std::string& service : std::views::reverse(service::service_names())) {
    const std::string file = "railfix-" + dashed(service);
    if (!std::filesystem::exists(folder / file)) {
      return core::Error{(folder / file).string() + " is missing; build it with ./dev build"};
    }
    programs.push_back({service, folder / file, service != "monitor"});
  }
  return programs;
}

Processes::Processes(std::filesystem::path log_dir) : log_dir_(std::move(log_dir)) {
  std::filesystem::create_directories(log_dir_);
}

Processes::~Processes() {
  const auto status = stop_all(2.0);
  static_cast<void>(status);  // nothing is left to be done with it
}

core::Status Processes::start(const ServiceProgram& program, const std::vector<std::string>& arguments) {
  const auto log_file = log_dir_ / (program.service + ".log");
  const int log = open(log_file.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);
  if (log < 0) return core::cannot_write(log_file.string());
  const pid_t pid = fork();
  if (pid == 0) become(program.program, arguments, log);
  close(log);
  if (pid < 0) return core::Error{program.program.string() + " cannot be started: " + std::strerror(errno)};
  children_.push_back({program.service, program.needed, pid, false, 0});
  return {};
}

void Processes::reap() {
  for (auto& child : children_) {
    if (!child.ended && waitpid(child.pid, &child.wait_status, WNOHANG) == child.pid) child.ended = true;
  }
}

std::optional<std::string> Processes::unexpected_end() {
  reap();
  for (const auto& child : children_) {
    if (!child.ended || !child.needed) continue;
    return child.service + " " + describe(child.wait_status) + "; its log (" +
           (log_dir_ / (child.service + ".log")).string() + ") ends with:\n" + log_tail(child.service);
  }
  return std::nullopt;
}

std::string Processes::log_tail(const std::string& service) const {
  std::ifstream log(log_dir_ / (service + ".log"));
  std::deque<std::string> lines;
  for (std::string line; std::getline(log, line);) {
    lines.push_back(line);
    if (lines.size() > kTailLines) lines.pop_front();
  }
  std::string text;
  for (const auto& line : lines) text += "  " + line + "\n";
  return text;
}

std::vector<std::string> Processes::running() const {
  std::vector<std::string> names;
  for (const auto& child : children_) {
    if (!child.ended) names.push_back(child.service);
  }
  return names;
}

core::Status Processes::stop(const std::vector<std::string>& services, double patience_s) {
  const auto chosen = [&](const Child& child) {
    return !child.ended && std::find(services.begin(), services.end(), child.service) != services.end();
  };
  for (const auto& child : children_) {
    if (chosen(child)) kill(child.pid, SIGTERM);
  }
  const int64_t deadline_ns = core::monotonic_ns() + core::to_ns(patience_s);
  while (std::any_of(children_.begin(), children_.end(), chosen) && core::monotonic_ns() < deadline_ns) {
    reap();
    poll(nullptr, 0, kPollMs);
  }
  std::string stuck;
  for (auto& child : children_) {
    if (!chosen(child)) continue;
    stuck += (stuck.empty() ? "" : ", ") + child.service;
    kill(child.pid, SIGKILL);
    waitpid(child.pid, &child.wait_status, 0);
    child.ended = true;
  }
  if (!stuck.empty())
    return core::Error{"did not end within " + std::to_string(static_cast<int>(patience_s)) +
                       " s and had to be killed: " + stuck};
  return {};
}

core::Status Processes::stop_all(double patience_s) {
  auto before = running();
  std::erase(before, "recorder");
  const auto others = stop(before, patience_s);
  const auto recorder = stop({"recorder"}, kRecorderS);
  if (others.ok() || recorder.ok()) return others.ok() ? recorder : others;
  return core::Error{others.error().message + "\n" + recorder.error().message};
}

}  // namespace railfix::tool
