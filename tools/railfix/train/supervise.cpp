#include "train/supervise.hpp"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <sys/file.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <cstring>
#include <fstream>
#include <ranges>

#include "core/time.hpp"
#include "service/health_file.hpp"
#include "train/left_behind.hpp"
#include "train/stands_still.hpp"

namespace railfix::tool {
namespace {

namespace fs = std::filesystem;

constexpr int kTurnMs = 20;
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
// A participant that died is forgotten after 5 s, and then nobody has its pictures mapped.
constexpr int64_t kForgottenNs = 10 * core::kNsPerSecond;
constexpr size_t kLastWords = 300;
constexpr int64_t kStopNs = 10 * core::kNsPerSecond;

volatile std::sig_atomic_t asked_to_stop = 0;

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

// To its end, without a word.
void run_quietly(const std::vector<std::string>& command) {
  if (command.empty()) return;
  const pid_t pid = fork();
  if (pid == 0) {
    const int nothing = open("/dev/null", O_RDWR);
    for (const int file : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO}) dup2(nothing, file);
    execute(command);
  }
  if (pid > 0) waitpid(pid, nullptr, 0);
}

[[noreturn]] void become(const PlannedService& service, bool beside, const fs::path& home, int log) {
  setpgid(0, 0);
  for (const int signal : {SIGINT, SIGTERM}) std::signal(signal, SIG_DFL);
  run_quietly(service.clean_up);
  dup2(log, STDOUT_FILENO);
  dup2(log, STDERR_FILENO);
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
  return last.substr(0, kLastWords);
}

/// One service of the plan and its process.
class Child {
 public:
  /// `beside`: another one of this service runs, which it is to replace.
  Child(PlannedService service, const HostFolder& folder, const service::CommonConfig& common, bool beside)
      : service_(std::move(service)),
        home_(folder.home()),
        log_(folder.log(service_.name)),
        usual_health_(service::health_path(common, service_.name)),
        health_(beside ? service::health_path_beside(common, service_.name) : usual_health_),
        beside_(beside) {}
  [[nodiscard]] const PlannedService& service() const { return service_; }
  [[nodiscard]] RunningService state() const {
    return {pid_, service_.generation, restarts_, last_end_, beside_, born_};
  }
  /// It runs already: the supervisor before has started it, and has died.
  void adopt(const RunningService& running) {
    pid_ = static_cast<pid_t>(running.pid);
    born_ = running.born;
    restarts_ = running.restarts;
    last_end_ = running.last_end;
    adopted_ = true;
    well_since_ns_ = core::monotonic_ns();
    std::error_code none;
    const auto bytes = fs::file_size(log_, none);
    log_began_ = none ? 0 : static_cast<std::streamoff>(bytes);
  }
  [[nodiscard]] bool runs() const { return pid_ > 0; }
  /// Runs well for so long that it has found everybody.
  [[nodiscard]] bool has_found_all() const { return pid_ > 0 && core::monotonic_ns() - well_since_ns_ > kFoundNs; }
  /// The one that it ran beside has gone.
  void take_its_place() {
    std::error_code none;
    fs::rename(health_, usual_health_, none);
    health_ = usual_health_;
    beside_ = false;
  }

  /// Starts it when it is time, notes its end. True when something has changed.
  bool turn() {
    const int64_t now_ns = core::monotonic_ns();
    if (pid_ > 0) {
      look(now_ns);
      return note_end(now_ns);
    }
    if (now_ns < next_start_ns_) return false;
    start(now_ns);
    return true;
  }
  void ask_to_stop() const {
    if (pid_ > 0) kill(pid_, SIGTERM);
  }
  void kill_it() {
    if (pid_ <= 0) return;
    run_quietly(service_.clean_up);
    kill(pid_, SIGKILL);
    while (!ended()) poll(nullptr, 0, kTurnMs);
    forget_health();
  }
  bool ended() {
    int ignored = 0;
    if (pid_ > 0 && has_ended(ignored)) pid_ = 0;
    return pid_ == 0;
  }

 private:
  // One that was adopted is another process's child.
  bool has_ended(int& wait_status) const {
    return adopted_ ? born_of(pid_) != born_ : waitpid(pid_, &wait_status, WNOHANG) == pid_;
  }
  // A killed one leaves its last words, which would speak for the next one.
  void forget_health() const {
    std::error_code none;
    fs::remove(health_, none);
  }
  void look(int64_t now_ns) {
    if (now_ns - looked_ns_ < kLookNs) return;
    looked_ns_ = now_ns;
    kill_when_frozen(now_ns);
    if (!beside_) return;
    const auto health = service::ask_health(health_);
    if (!health.healthy || health.starting) well_since_ns_ = now_ns;
  }
  // One that has spoken since it was started, and is silent now: nobody else would ever end it.
  void kill_when_frozen(int64_t now_ns) {
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
  void start(int64_t now_ns) {
    forget_health();
    for (const auto& folder : {home_, log_.parent_path()}) fs::create_directories(folder);
    const int log = open(log_.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0644);
    log_began_ = log < 0 ? 0 : lseek(log, 0, SEEK_END);
    pid_ = fork();
    if (pid_ == 0) become(service_, beside_, home_, log);
    if (log >= 0) close(log);
    started_ns_ = well_since_ns_ = now_ns;
    adopted_ = false;
    born_ = pid_ > 0 ? born_of(pid_) : 0;
    if (pid_ > 0) return;
    pid_ = 0;
    next_start_ns_ = now_ns + kLongestPauseNs;
    last_end_ = std::string("cannot be started: ") + std::strerror(errno);
  }
  bool note_end(int64_t now_ns) {
    int wait_status = 0;
    if (!has_ended(wait_status)) return false;
    pid_ = 0;
    ++restarts_;
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

  PlannedService service_;
  fs::path home_;
  fs::path log_;
  fs::path usual_health_;
  fs::path health_;
  bool beside_ = false;
  int64_t well_since_ns_ = 0;
  int frozen_looks_ = 0;
  int64_t looked_ns_ = 0;
  pid_t pid_ = 0;
  int64_t born_ = 0;
  bool adopted_ = false;
  int restarts_ = 0;
  std::string last_end_;
  std::streamoff log_began_ = 0;
  int64_t started_ns_ = 0;
  int64_t next_start_ns_ = 0;
  int64_t pause_ns_ = kFirstPauseNs / 2;
};

// Those who listen go last, so that the recorder and the monitor hear everyone's last words.
void stop(std::vector<Child*> children) {
  for (auto* child : children) child->ask_to_stop();
  const int64_t deadline_ns = core::monotonic_ns() + kStopNs;
  const auto all_ended = [&] {
    bool ended = true;
    for (auto* child : children) ended = child->ended() && ended;
    return ended;
  };
  while (!all_ended() && core::monotonic_ns() < deadline_ns) poll(nullptr, 0, kTurnMs);
  for (auto* child : children) child->kill_it();
}

class Supervision {
 public:
  explicit Supervision(const HostFolder& folder) : folder_(folder) {}
  void turn() {
    follow_plan();
    bool changed = false;
    for (auto* children : {&children_, &successors_}) {
      for (auto& child : *children) changed = child.turn() || changed;
    }
    changed = hand_over() || changed;
    if (changed) {
      say();
      clean_ns_ = core::monotonic_ns() + kForgottenNs;
    }
    clean();
  }
  void end() {
    std::vector<Child*> speakers;
    std::vector<Child*> listeners;
    for (auto& child : successors_) speakers.push_back(&child);
    for (auto& child : children_) {
      const bool listens = child.service().name == "recorder" || child.service().name == "monitor";
      (listens ? listeners : speakers).push_back(&child);
    }
    stop(speakers);
    stop(listeners);
    children_.clear();
    successors_.clear();
    say();
  }

 private:
  // What killed services have left, in two looks.
  void clean() {
    const int64_t now_ns = core::monotonic_ns();
    if (clean_ns_ == 0 || now_ns < clean_ns_) return;
    if (!left_) {
      left_ = left_behind();
      clean_ns_ = now_ns + core::kNsPerSecond;
      return;
    }
    remove_left_behind(*left_);
    left_.reset();
    clean_ns_ = 0;
  }
  void follow_plan() {
    const auto written = folder_.plan_written();
    if (written == plan_written_) return;
    plan_written_ = written;
    const auto plan = folder_.plan();
    if (!plan || plan->services == planned_) return;
    const bool first = planned_.empty();
    planned_ = plan->services;
    if (first) adopt_running(*plan);
    const auto goes = [this](const Child& child) { return !is_planned(child) && !is_succeeded(child); };
    const auto falls_out = [this](const Child& successor) { return !is_planned(successor); };
    std::vector<Child*> leaving;
    for (auto& child : children_) {
      if (goes(child)) leaving.push_back(&child);
    }
    for (auto& successor : successors_) {
      if (falls_out(successor)) leaving.push_back(&successor);
    }
    stop(leaving);
    std::erase_if(children_, goes);
    std::erase_if(successors_, falls_out);
    start_new(*plan);
    say();
  }
  // What a supervisor that was killed has left goes on. What the plan says by now replaces it in the usual way.
  void adopt_running(const HostPlan& plan) {
    const auto common = common_of(plan);
    for (const auto& [key, running] : folder_.state()) {
      const auto pid = static_cast<pid_t>(running.pid);
      if (pid <= 0 || running.born == 0 || born_of(pid) != running.born) continue;
      PlannedService service;
      service.name = key.substr(0, key.find(kBefore));
      service.generation = running.generation;
      service.command = command_of(pid);
      if (!service.command.empty() && service.command.back() == "--beside") service.command.pop_back();
      const auto* planned = plan.service(service.name);
      const bool as_planned = planned != nullptr && planned->command == service.command;
      auto& children = running.beside ? successors_ : children_;
      children.emplace_back(as_planned ? *planned : service, folder_, common, running.beside);
      children.back().adopt(running);
    }
  }
  [[nodiscard]] static service::CommonConfig common_of(const HostPlan& plan) {
    service::CommonConfig common;
    common.train_id = plan.train_id;
    common.host = plan.host;
    return common;
  }
  [[nodiscard]] bool is_planned(const Child& child) const {
    return std::find(planned_.begin(), planned_.end(), child.service()) != planned_.end();
  }
  /// It goes when the new one beside it has found everybody.
  [[nodiscard]] bool is_succeeded(const Child& child) const {
    return child.runs() && std::any_of(planned_.begin(), planned_.end(), [&](const PlannedService& service) {
             return service.name == child.service().name && service.runs_beside();
           });
  }
  // Against the way of the data: who listens is there before who speaks.
  void start_new(const HostPlan& plan) {
    const auto common = common_of(plan);
    for (const auto& service : std::views::reverse(planned_)) {
      const auto is_it = [&](const Child& child) { return child.service() == service; };
      if (std::any_of(children_.begin(), children_.end(), is_it) ||
          std::any_of(successors_.begin(), successors_.end(), is_it))
        continue;
      const bool beside = std::any_of(children_.begin(), children_.end(),
                                      [&](const Child& child) { return child.service().name == service.name; });
      (beside ? successors_ : children_).emplace_back(service, folder_, common, beside);
    }
  }
  /// True when a successor has taken the place of the one before.
  bool hand_over() {
    const auto before_of = [this](const Child& successor) {
      return std::find_if(children_.begin(), children_.end(),
                          [&](const Child& child) { return child.service().name == successor.service().name; });
    };
    const auto is_due = [&](const Child& successor) {
      const auto before = before_of(successor);
      return before == children_.end() || (before->runs() ? successor.has_found_all() : successor.runs());
    };
    const auto due = std::find_if(successors_.begin(), successors_.end(), is_due);
    if (due == successors_.end()) return false;
    if (const auto before = before_of(*due); before != children_.end()) {
      stop({&*before});
      children_.erase(before);
    }
    children_.push_back(std::move(*due));
    successors_.erase(due);
    children_.back().take_its_place();
    return true;
  }
  void say() const {
    HostState state;
    for (const auto& child : children_) state[child.service().name] = child.state();
    for (const auto& successor : successors_) {
      const auto& name = successor.service().name;
      if (const auto before = state.extract(name)) state[name + kBefore] = before.mapped();
      state[name] = successor.state();
    }
    static_cast<void>(folder_.write(state));  // a full disk must not end the train
  }
  const HostFolder& folder_;
  fs::file_time_type plan_written_{};
  int64_t clean_ns_ = 0;  // 0 = there is nothing to be cleaned
  std::optional<std::vector<fs::path>> left_;
  std::vector<PlannedService> planned_;
  std::vector<Child> children_;
  std::vector<Child> successors_;  // each runs beside the child of its name
};

}  // namespace

void supervise(const HostFolder& folder) {
  fs::create_directories(folder.lock().parent_path());
  const int lock = open(folder.lock().c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0644);
  if (lock < 0 || flock(lock, LOCK_EX | LOCK_NB) != 0) {
    throw core::BadInput(folder.lock().string() +
                         " is held: a supervisor runs here already, or this user may not write there");
  }
  const std::string pid = std::to_string(getpid()) + "\n";
  if (ftruncate(lock, 0) != 0 || pwrite(lock, pid.data(), pid.size(), 0) < 0)
    throw core::BadInput(folder.lock().string() + " cannot be written; is the disk full?");
  for (const int signal : {SIGINT, SIGTERM}) std::signal(signal, [](int) { asked_to_stop = 1; });
  Supervision supervision(folder);
  // Once in any case: who is told to end at once ends what the one before has left.
  do {
    supervision.turn();
    poll(nullptr, 0, kTurnMs);
  } while (asked_to_stop == 0);
  supervision.end();
  close(lock);
}

std::optional<int64_t> supervisor_of(const HostFolder& folder) {
  const int lock = open(folder.lock().c_str(), O_RDWR | O_CLOEXEC);
  if (lock < 0) return std::nullopt;
  const bool free = flock(lock, LOCK_EX | LOCK_NB) == 0;
  char text[32] = {};
  const auto bytes = pread(lock, text, sizeof(text) - 1, 0);
  close(lock);
  if (free || bytes <= 0) return std::nullopt;
  return std::atoll(text);
}

}  // namespace railfix::tool
