#include "train/supervise.hpp"

#include <fcntl.h>
#include <poll.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <iostream>
#include <ranges>
#include <utility>

#include "core/time.hpp"
#include "core/whole_file.hpp"
#include "messaging/security.hpp"
#include "train/file_lock.hpp"
#include "train/left_behind.hpp"
#include "train/running.hpp"
#include "train/stands_still.hpp"
#include "train/supervised_service.hpp"

namespace railfix::tool {
namespace {

namespace fs = std::filesystem;

constexpr int kTurnMs = 20;
constexpr double kLockPatienceS = 0.2;  // who asks whether there is a supervisor holds the lock for a moment, too
// A participant that died is forgotten after 5 s, and then nobody has its pictures mapped.
constexpr int64_t kForgottenNs = 10 * core::kNsPerSecond;

volatile std::sig_atomic_t asked_to_stop = 0;

class Supervision {
 public:
  explicit Supervision(const HostFolder& folder) : folder_(folder) {}
  void turn() {
    follow_plan();
    bool changed = turn_leaving();
    for (auto* children : {&children_, &successors_}) {
      for (auto& child : *children) changed = (may_turn(child) && child.turn()) || changed;
    }
    changed = hand_over() || changed;
    if (changed) {
      say();
      changed_ns_ = core::monotonic_ns();
    }
    clean();
  }
  // Those who listen go last, so that the recorder and the monitor hear everyone's last words.
  void end() {
    leave_if(successors_, [](const auto&) { return true; });
    leave_if(children_,
             [](const auto& child) { return child.service().name != "recorder" && child.service().name != "monitor"; });
    wait_for_leaving();
    leave_if(children_, [](const auto&) { return true; });
    wait_for_leaving();
    say();
  }
  /// Those that not even a kill has ended.
  void say_left() const {
    for (const auto& child : leaving_) {
      if (!child.runs()) continue;
      std::cerr << "railfix: " << child.service().name << ", process " << child.state().pid
                << ", was killed and does not end: the kernel waits for a disk or a device; free that, or restart the "
                << "computer" << std::endl;
    }
  }

 private:
  // What killed services have left, in two looks. Not only when all is quiet: a service that ends again and again may
  // do so for the room that is taken.
  void clean() {
    const int64_t now_ns = core::monotonic_ns();
    if (clean_ns_ == 0 && changed_ns_ != 0) clean_ns_ = std::exchange(changed_ns_, 0) + kForgottenNs;
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
    const auto plan = or_nothing([this] { return folder_.plan(); });
    if (plan) setenv(messaging::kTrainFolder, plan->train_folder.c_str(), 1);  // for what is started from now on
    if (!plan || (!plan->down && plan->services == planned_)) return;
    if (planned_.empty()) adopt_running(*plan);
    if (plan->down) {
      end();
      planned_.clear();
      return;
    }
    planned_ = plan->services;
    const auto goes = [this](const SupervisedService& child) { return !is_planned(child) && !is_succeeded(child); };
    const auto falls_out = [this](const SupervisedService& successor) { return !is_planned(successor); };
    leave_if(children_, goes);
    leave_if(successors_, falls_out);
    start_new(*plan);
    say();
  }
  /// Of a file of ours that is damaged, which is said: what runs goes on.
  template <class Read>
  static auto or_nothing(Read read) -> decltype(read()) {
    try {
      return read();
    } catch (const core::BadInput& damaged) {
      std::cerr << "railfix: " << damaged.what() << std::endl;
      return {};
    }
  }
  // What a supervisor that was killed has left goes on. What the plan says by now replaces it in the usual way.
  void adopt_running(const HostPlan& plan) {
    const auto common = common_of(plan);
    const auto all = running_on(folder_, or_nothing([this] { return folder_.state(); }));
    for (const auto& [key, running] : all) {
      PlannedService service;
      service.name = service_of(key);
      service.generation = running.generation;
      service.command = usual_command(command_of(static_cast<pid_t>(running.pid)));
      const auto* planned = plan.service(service.name);
      const bool as_planned = planned != nullptr && planned->command == service.command;
      auto& children = running.beside ? successors_ : children_;
      children.emplace_back(as_planned ? *planned : service, folder_, common, running.beside);
      children.back().adopt(running);
      const bool too_many = key.find(kTooMany) != std::string::npos;
      std::cerr << "railfix: " << (too_many ? "ends a second " : "goes on with ") << service.name << ", process "
                << running.pid << std::endl;
      if (!too_many) continue;
      leave(std::move(children.back()));
      children.pop_back();
    }
  }
  // Nobody waits for its end: the others are looked after meanwhile.
  void leave(SupervisedService child) {
    child.ask_to_end();
    leaving_.push_back(std::move(child));
  }
  template <class Leaves>
  void leave_if(std::vector<SupervisedService>& children, Leaves leaves) {
    for (auto& child : children) {
      if (leaves(child)) leave(child);
    }
    std::erase_if(children, leaves);
  }
  bool turn_leaving() {
    return std::erase_if(leaving_, [](SupervisedService& child) { return child.turn_to_end(); }) > 0;
  }
  void wait_for_leaving() {
    const auto in_the_way = [](const SupervisedService& child) { return child.is_in_the_way(); };
    for (turn_leaving(); std::ranges::any_of(leaving_, in_the_way); turn_leaving()) poll(nullptr, 0, kTurnMs);
  }
  [[nodiscard]] bool is_free(const std::string& name) const {
    return std::ranges::none_of(leaving_, [&](const SupervisedService& child) {
      return child.service().name == name && child.is_in_the_way();
    });
  }
  /// Another one of its name has to end first, or to give the files free that stand for one that runs beside.
  [[nodiscard]] bool may_turn(const SupervisedService& child) const {
    if (child.runs()) return true;
    const bool second = std::ranges::any_of(children_, [&](const SupervisedService& other) {
      return &other != &child && other.service().name == child.service().name && other.is_beside();
    });
    return is_free(child.service().name) && !second;
  }
  [[nodiscard]] static service::CommonConfig common_of(const HostPlan& plan) {
    service::CommonConfig common;
    common.train_id = plan.train_id;
    common.host = plan.host;
    return common;
  }
  [[nodiscard]] bool is_planned(const SupervisedService& child) const {
    return std::find(planned_.begin(), planned_.end(), child.service()) != planned_.end();
  }
  /// It goes when the new one beside it has found everybody.
  [[nodiscard]] bool is_succeeded(const SupervisedService& child) const {
    return child.runs() && std::any_of(planned_.begin(), planned_.end(), [&](const PlannedService& service) {
             return service.name == child.service().name && service.runs_beside();
           });
  }
  // Against the way of the data: who listens is there before who speaks.
  void start_new(const HostPlan& plan) {
    const auto common = common_of(plan);
    for (const auto& service : std::views::reverse(planned_)) {
      const auto is_it = [&](const SupervisedService& child) { return child.service() == service; };
      if (std::any_of(children_.begin(), children_.end(), is_it) ||
          std::any_of(successors_.begin(), successors_.end(), is_it))
        continue;
      const bool beside = std::any_of(children_.begin(), children_.end(), [&](const SupervisedService& child) {
        return child.service().name == service.name;
      });
      (beside ? successors_ : children_).emplace_back(service, folder_, common, beside);
    }
  }
  /// True when a successor has taken the place of the one before, or the files of that one.
  bool hand_over() {
    const auto before_of = [this](const SupervisedService& successor) {
      return std::find_if(children_.begin(), children_.end(), [&](const SupervisedService& child) {
        return child.service().name == successor.service().name;
      });
    };
    const auto is_due = [&](const SupervisedService& successor) {
      const auto before = before_of(successor);
      return before == children_.end() || (before->runs() ? successor.has_found_all() : successor.runs());
    };
    const auto due = std::find_if(successors_.begin(), successors_.end(), is_due);
    bool changed = due != successors_.end();
    if (changed) {
      if (const auto before = before_of(*due); before != children_.end()) {
        leave(std::move(*before));
        children_.erase(before);
      }
      children_.push_back(std::move(*due));
      successors_.erase(due);
    }
    for (auto& child : children_) {
      if (child.is_beside() && is_free(child.service().name)) changed = child.take_its_place() || changed;
    }
    return changed;
  }
  void say() const {
    HostState state;
    for (const auto& child : children_) state[child.service().name] = child.state();
    for (const auto& successor : successors_) {
      const auto& name = successor.service().name;
      if (const auto before = state.extract(name)) state[name + kBefore] = before.mapped();
      state[name] = successor.state();
    }
    for (const auto& child : leaving_) add_leaving(child, state);
    static_cast<void>(folder_.write(state));  // a full disk must not end the train
  }
  static void add_leaving(const SupervisedService& child, HostState& state) {
    const auto& name = child.service().name;
    const auto process = child.state();
    if (child.runs())
      state[name + (state.contains(name + kBefore) ? kTooMany + std::to_string(process.pid) : kBefore)] = process;
    const auto next = state.find(name);
    if (next == state.end() || next->second.pid > 0 || !child.is_in_the_way()) return;
    next->second.last_end = "waits for process " + std::to_string(process.pid) + " of generation " +
                            std::to_string(process.generation) + ", which was told to end";
  }
  const HostFolder& folder_;
  fs::file_time_type plan_written_{};
  int64_t changed_ns_ = 0;  // 0 = nothing has changed since clean_ns_ was set
  int64_t clean_ns_ = 0;    // 0 = there is nothing to be cleaned
  std::optional<std::vector<fs::path>> left_;
  std::vector<PlannedService> planned_;
  std::vector<SupervisedService> children_;
  std::vector<SupervisedService> successors_;  // each runs beside the child of its name
  std::vector<SupervisedService> leaving_;     // were asked to end
};

}  // namespace

void supervise(const HostFolder& folder) {
  const FileLock lock(folder.lock(), kLockPatienceS);
  if (!lock.is_held()) {
    throw core::BadInput(folder.lock().string() +
                         " is held: a supervisor runs here already, or this user may not write there");
  }
  if (!lock.sign(std::to_string(getpid()) + "\n")) throw core::BadInput(core::cannot_write(folder.lock().string()));
  for (const int signal : {SIGINT, SIGTERM}) std::signal(signal, [](int) { asked_to_stop = 1; });
  Supervision supervision(folder);
  // Once in any case: who is told to end at once ends what the one before has left.
  do {
    supervision.turn();
    poll(nullptr, 0, kTurnMs);
  } while (asked_to_stop == 0);
  supervision.end();
  supervision.say_left();
}

std::optional<int64_t> supervisor_of(const HostFolder& folder) {
  const int lock = open(folder.lock().c_str(), O_RDONLY | O_CLOEXEC);  // anybody may ask
  if (lock < 0) return std::nullopt;
  const bool free = flock(lock, LOCK_SH | LOCK_NB) == 0;
  char text[32] = {};
  const auto bytes = pread(lock, text, sizeof(text) - 1, 0);
  close(lock);
  if (free || bytes <= 0) return std::nullopt;
  return std::atoll(text);
}

}  // namespace railfix::tool
