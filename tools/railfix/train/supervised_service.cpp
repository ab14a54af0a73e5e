#include "train/supervised_service.hpp"

#include <fcntl.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <cstring>
#include <fstream>

#include "core/cut_text.hpp"
#include "core/time.hpp"
#include "service/health_file.hpp"
#include "train/log_file.hpp"
#include "train/stands_still.hpp"

namespace railfix::tool {
namespace {

namespace fs = std::filesystem;

constexpr int64_t kFirstPauseNs = 200'000'000;  // of one that does not live long
constexpr int64_t kLongestPauseNs = 5 * core::kNsPerSecond;
constexpr int64_t kLivesNs = 10 * core::kNsPerSecond;
// A run loop says ten times a second that it turns. One that is silent for kQuietNs while none of its threads does
// or wants to do anything hangs; one that is busy may take longer, but not kFrozenNs: its longest work is about a
// second.
constexpr int64_t kQuietNs = 300'000'000;
constexpr int64_t kFrozenNs = 3 * core::kNsPerSecond;
constexpr int64_t kLookNs = core::kNsPerSecond / 20;
constexpr int kFrozenLooks = 3;  // after a computer that stood still everybody may speak first
// DDS finds everybody within a second, and one that stands by counts as fit after two more (service/charge.hpp).
constexpr int64_t kFoundNs = 3'500'000'000;
// For the end of the data's way and of its ears one after the other, within the 40 s that `down` and systemd wait.
constexpr int64_t kStopNs = 10 * core::kNsPerSecond;
constexpr int64_t kCleanNs = 6 * core::kNsPerSecond;
constexpr int64_t kDeadNs = core::kNsPerSecond;
constexpr size_t kLastWords = 300;
constexpr int kRefuses = 2;  // exit code of a service whose configuration is wrong (service/run.cpp)

std::string said_of(int wait_status) {
  if (WIFSIGNALED(wait_status)) return std::string("ended by ") + strsignal(WTERMSIG(wait_status));
  return "ended with exit code " + std::to_string(WEXITSTATUS(wait_status));
}

[[noreturn]] void execute(const std::vector<std::string>& command) {
  std::vector<char*> argv;
  for (const auto& argument : command) argv.push_back(const_cast<char*>(argument.c_str()));
  argv.push_back(nullptr);
  execv(argv[0], argv.data());
  _exit(127);
}

// Without a word. 0: there is nothing to be run, or it cannot be.
pid_t start_quietly(const std::vector<std::string>& command) {
  if (command.empty()) return 0;
  const pid_t pid = fork();
  if (pid == 0) {
    const int nothing = open("/dev/null", O_RDWR);
    for (const int file : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO}) dup2(nothing, file);
    execute(command);
  }
  return std::max(pid, 0);
}

[[noreturn]] void become(const PlannedService& service, bool beside, const std::string& ended_before,
                         const fs::path& home, int log) {
  setpgid(0, 0);
  for (const int signal : {SIGINT, SIGTERM}) std::signal(signal, SIG_DFL);
  // In this process, so that nobody else waits for an engine that hangs.
  if (const pid_t cleaner = start_quietly(service.clean_up); cleaner > 0) waitpid(cleaner, nullptr, 0);
  dup2(log, STDOUT_FILENO);
  dup2(log, STDERR_FILENO);
  setenv(service::kEndedBefore, ended_before.c_str(), 1);
  auto command = service.command;
  if (beside) command.emplace_back("--beside");
  if (chdir(home.c_str()) == 0) execute(command);
  _exit(127);
}

// What it said last, after `from`: an engine's complaint, or the service's own.
std::string last_words(const fs::path& log, std::streamoff from) {
  std::ifstream in(log);
  in.seekg(from);
  std::string last;
  for (std::string line; std::getline(in, line);) {
    if (!line.empty()) last = line;
  }
  return core::cut_text(last, kLastWords);
}

}  // namespace

SupervisedService::SupervisedService(PlannedService service, const HostFolder& folder,
                                     const service::CommonConfig& common, bool beside)
    : service_(std::move(service)),
      home_(folder.home()),
      log_(folder.log(service_.name)),
      usual_health_(service::health_path(common, service_.name)),
      health_(beside ? service::health_path_beside(common, service_.name) : usual_health_),
      beside_(beside),
      pause_ns_(kFirstPauseNs / 2) {}

void SupervisedService::adopt(const RunningService& running) {
  pid_ = static_cast<pid_t>(running.pid);
  born_ = running.born;
  restarts_ = running.restarts;
  last_end_ = running.last_end;
  refused_ = running.refused;
  adopted_ = true;
  well_since_ns_ = core::monotonic_ns();
  std::error_code none;
  const auto bytes = fs::file_size(log_, none);
  log_began_ = none ? 0 : static_cast<std::streamoff>(bytes);
}

bool SupervisedService::has_found_all() const {
  return pid_ > 0 && core::monotonic_ns() - well_since_ns_ > kFoundNs;
}

bool SupervisedService::take_its_place() {
  std::error_code failed;
  fs::rename(health_, usual_health_, failed);
  if (failed) return false;
  health_ = usual_health_;
  beside_ = false;
  return true;
}

bool SupervisedService::turn() {
  const int64_t now_ns = core::monotonic_ns();
  if (pid_ > 0) {
    look(now_ns);
    return note_end(now_ns);
  }
  if (now_ns < next_start_ns_) return false;
  start(now_ns);
  return true;
}

void SupervisedService::ask_to_end() {
  asked_ns_ = core::monotonic_ns();
  if (pid_ > 0) kill(pid_, SIGTERM);
}

bool SupervisedService::turn_to_end() {
  int ignored = 0;
  if (pid_ > 0 && has_ended(ignored)) {
    // One that was started beside another one does not know its file under the usual name; where it was in nobody's way
    // any more, the file may be the next one's.
    if (is_in_the_way()) forget_health();
    pid_ = 0;
  }
  if (cleaner_ > 0 && waitpid(cleaner_, nullptr, WNOHANG) == cleaner_) cleaner_ = 0;
  if (pid_ == 0 && cleaner_ == 0) return true;
  insist(core::monotonic_ns());
  return false;
}

void SupervisedService::insist(int64_t now_ns) {
  const int64_t waited_ns = now_ns - asked_ns_;
  if (waited_ns < kStopNs || killed_ns_ != 0) return;
  if (!insisted_ && service_.in_container()) {
    insisted_ = true;
    // With its process the container ends, and the engine has less to do.
    if (const pid_t process = holder_of(health_); process > 0) kill(process, SIGKILL);
    cleaner_ = start_quietly(service_.clean_up);
  }
  if (cleaner_ > 0 && waited_ns < kStopNs + kCleanNs) return;
  for (const pid_t process : {pid_, cleaner_}) {
    if (process > 0) kill(process, SIGKILL);
  }
  killed_ns_ = now_ns;
}

bool SupervisedService::is_in_the_way() const {
  const bool is_dead = killed_ns_ != 0 && core::monotonic_ns() - killed_ns_ > kDeadNs;
  return (pid_ > 0 || cleaner_ > 0) && !is_dead;
}

// One that was adopted is another process's child.
bool SupervisedService::has_ended(int& wait_status) const {
  return adopted_ ? born_of(pid_) != born_ : waitpid(pid_, &wait_status, WNOHANG) == pid_;
}

// A killed one leaves its last words, which would speak for the next one.
void SupervisedService::forget_health() const {
  std::error_code none;
  fs::remove(health_, none);
}

void SupervisedService::look(int64_t now_ns) {
  if (now_ns - looked_ns_ < kLookNs) return;
  looked_ns_ = now_ns;
  kill_when_frozen(now_ns);
  if (!beside_) return;
  const auto health = service::ask_health(health_);
  if (!health.healthy || health.starting) well_since_ns_ = now_ns;
}

// One that has spoken since it was started, and is silent now: nobody else would ever end it.
void SupervisedService::kill_when_frozen(int64_t now_ns) {
  const auto silent_ns = service::silent_ns(health_);
  const bool has_spoken = silent_ns && *silent_ns < now_ns - started_ns_;
  if (!has_spoken || *silent_ns < kQuietNs) {
    frozen_looks_ = 0;
    return;
  }
  // A container's process is no child of its engine's; with it the container ends.
  const pid_t process = service_.in_container() ? holder_of(health_) : pid_;
  const bool hangs = *silent_ns > kFrozenNs || (process > 0 && stands_still(process));
  frozen_looks_ = hangs ? frozen_looks_ + 1 : 0;
  if (frozen_looks_ >= kFrozenLooks) kill(process > 0 ? process : pid_, SIGKILL);
}

void SupervisedService::start(int64_t now_ns) {
  forget_health();
  fs::create_directories(home_);
  const int log = open_log(log_);
  log_began_ = log < 0 ? 0 : lseek(log, 0, SEEK_END);
  pid_ = fork();
  if (pid_ == 0) become(service_, beside_, last_end_, home_, log);
  if (log >= 0) close(log);
  started_ns_ = well_since_ns_ = now_ns;
  adopted_ = false;
  born_ = pid_ > 0 ? born_of(pid_) : 0;
  if (pid_ > 0) return;
  pid_ = 0;
  next_start_ns_ = now_ns + kLongestPauseNs;
  last_end_ = std::string("cannot be started: ") + std::strerror(errno);
}

bool SupervisedService::note_end(int64_t now_ns) {
  int wait_status = 0;
  if (!has_ended(wait_status)) return false;
  pid_ = 0;
  ++restarts_;
  refused_ = WIFEXITED(wait_status) && WEXITSTATUS(wait_status) == kRefuses;
  last_end_ = (frozen_looks_ >= kFrozenLooks ? "was frozen, " : "") +
              (adopted_ ? "ended, how only the supervisor before knew" : said_of(wait_status));
  frozen_looks_ = 0;
  forget_health();
  if (const auto said = wait_status == 0 ? "" : last_words(log_, log_began_); !said.empty()) last_end_ += ": " + said;
  const bool lived = now_ns - started_ns_ > kLivesNs;
  pause_ns_ = lived ? kFirstPauseNs : std::min(2 * pause_ns_, kLongestPauseNs);
  next_start_ns_ = lived ? now_ns : now_ns + pause_ns_;
  return true;
}

}  // namespace railfix::tool
