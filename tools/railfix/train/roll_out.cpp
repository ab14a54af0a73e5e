#include "train/roll_out.hpp"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <unistd.h>

#include <algorithm>
#include <cstring>
#include <sstream>

#include "core/time.hpp"
#include "service/health_file.hpp"
#include "train/made_of.hpp"
#include "train/render.hpp"
#include "train/running.hpp"
#include "train/supervise.hpp"

namespace railfix::tool {
namespace {

namespace fs = std::filesystem;

constexpr int kTurnMs = 50;
constexpr double kStopS = 40;
constexpr double kBackS = 60;
constexpr int64_t kSayNs = 5 * core::kNsPerSecond;
constexpr const char* kNotTogether =
    ", which runs here: they would not hear each other; railfix train down on every host, then up";

template <class Condition>
bool wait_until(double patience_s, Condition condition) {
  const int64_t deadline_ns = core::monotonic_ns() + core::to_ns(patience_s);
  while (!condition()) {
    if (core::monotonic_ns() > deadline_ns) return false;
    poll(nullptr, 0, kTurnMs);
  }
  return true;
}

/// Watches one service until it has been healthy for long enough.
class Gate {
 public:
  /// `must_send`: it did before.
  Gate(const HostFolder& folder, const HostPlan& plan, std::string service, double healthy_s, bool must_send)
      : folder_(folder),
        plan_(plan),
        service_(std::move(service)),
        healthy_ns_(core::to_ns(healthy_s)),
        must_send_(must_send) {}
  bool passed() {
    const auto state = folder_.state();
    const auto found = state.find(service_);
    const int generation = plan_.service(service_)->generation;
    const bool there = found != state.end() && found->second.generation == generation;
    const bool ours = there && found->second.pid > 0 && !found->second.beside;
    refuses_ = there && found->second.pid == 0 && found->second.refused;
    health_ = health_of(plan_, state, service_);
    const int64_t now_ns = core::monotonic_ns();
    if (!ours || !health_.healthy || is_mute() || found->second.pid != pid_) {
      healthy_since_ns_ = now_ns;
      pid_ = ours ? found->second.pid : 0;
      return false;
    }
    return now_ns - healthy_since_ns_ >= healthy_ns_;
  }
  /// Nothing that it waits for would help: its configuration is wrong.
  [[nodiscard]] bool refuses() const { return refuses_; }
  [[nodiscard]] std::string why_not() const {
    return service_ + (health_.healthy && is_mute() ? " sends nothing, and did before: " : " ") + health_.text;
  }

 private:
  [[nodiscard]] bool is_mute() const { return must_send_ && !health_.sends && !health_.stands_by; }
  const HostFolder& folder_;
  const HostPlan& plan_;
  std::string service_;
  int64_t healthy_ns_;
  bool must_send_;
  bool refuses_ = false;
  int64_t healthy_since_ns_ = 0;
  int64_t pid_ = 0;
  service::HealthAnswer health_;
};

std::string problems_of(const std::vector<const Gate*>& gates) {
  std::string problems;
  for (const auto* gate : gates) problems += (problems.empty() ? "" : "; ") + gate->why_not();
  return problems;
}

core::Status wait_healthy(const HostFolder& folder, const HostPlan& plan, const std::vector<std::string>& services,
                          const HealthGate& gate, const Say& say, bool must_send = false) {
  std::vector<Gate> gates;
  for (const auto& service : services) gates.emplace_back(folder, plan, service, gate.healthy_s, must_send);
  std::vector<const Gate*> closed;
  bool refused = false;
  int64_t say_ns = core::monotonic_ns() + kSayNs;
  const bool ended = wait_until(gate.patience_s, [&] {
    closed.clear();
    for (auto& one : gates) {
      if (!one.passed()) closed.push_back(&one);
    }
    refused = std::ranges::any_of(closed, &Gate::refuses);
    if (core::monotonic_ns() > say_ns && !closed.empty() && !refused) {
      say("waiting: " + problems_of(closed));
      say_ns += kSayNs;
    }
    return closed.empty() || refused;
  });
  if (ended && !refused) return {};
  if (refused) std::erase_if(closed, [](const Gate* one) { return !one->refuses(); });
  return core::Error{problems_of(closed)};
}

// A process of its own session, so that it stays when the terminal goes.
core::Status start_supervisor(const fs::path& root) {
  const HostFolder folder(root);
  const auto program = fs::read_symlink("/proc/self/exe").string();
  const auto log_file = folder.log("supervisor");
  fs::create_directories(log_file.parent_path());
  const int log = open(log_file.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0644);
  const std::string at = fs::absolute(root).string();
  const pid_t pid = fork();
  if (pid == 0) {
    setsid();
    const int nothing = open("/dev/null", O_RDONLY);
    dup2(nothing, STDIN_FILENO);
    dup2(log, STDOUT_FILENO);
    dup2(log, STDERR_FILENO);
    execl(program.c_str(), program.c_str(), "train", "supervise", "--root", at.c_str(), nullptr);
    _exit(127);
  }
  if (log >= 0) close(log);
  if (pid < 0 || !wait_until(10, [&] { return supervisor_of(folder).has_value(); }))
    return core::Error{"the supervisor does not start; why stands in " + log_file.string()};
  return {};
}

// A container of exactly the image that the release's name stands for now, or a program.
core::Status set_commands(const Manifest& manifest, const TrainHost& host, const HostedService& service,
                          const fs::path& files, const fs::path& root, PlannedService& planned) {
  if (!manifest.containers) {
    const auto command = program_command(service, files, root);
    if (!command.ok()) return command.error();
    planned.command = command.value();
    return {};
  }
  const auto engine = container_engine(manifest);
  if (!engine.ok()) return engine.error();
  const auto absolute = [](const fs::path& path) { return fs::absolute(path).lexically_normal().string(); };
  auto container = container_of(manifest, host, service, absolute(files), absolute(HostFolder(root).home()));
  const auto id = image_id(engine.value(), container.image);
  if (!id) return core::Error{"image " + container.image + " is not on this computer"};
  container.image = *id;
  if (planned.runs_beside()) container.name += "-" + files.filename().string();
  planned.command = run_command(container, engine.value());
  planned.clean_up = remove_command(container, engine.value());
  return {};
}

std::vector<std::string> names_of(const HostPlan& plan) {
  std::vector<std::string> names;
  for (const auto& service : plan.services) names.push_back(service.name);
  return names;
}

// One step: this service as in `to`, everything else as it is.
HostPlan with_service(HostPlan plan, const HostPlan& to, const std::string& name) {
  std::erase_if(plan.services, [&](const auto& one) { return one.name == name; });
  if (const auto* service = to.service(name)) plan.services.push_back(*service);
  // The order of the data's way is that of the target.
  std::stable_sort(plan.services.begin(), plan.services.end(), [&](const auto& a, const auto& b) {
    const auto place = [&](const std::string& one) {
      return std::find_if(to.services.begin(), to.services.end(), [&](const auto& s) { return s.name == one; }) -
             to.services.begin();
    };
    return place(a.name) < place(b.name);
  });
  return plan;
}

std::vector<std::string> changed_services(const HostPlan& from, const HostPlan& to) {
  std::vector<std::string> changed;
  for (const auto& service : to.services) {
    const auto* now = from.service(service.name);
    if (now == nullptr || *now != service) changed.push_back(service.name);
  }
  for (const auto& service : from.services) {
    if (to.service(service.name) == nullptr) changed.push_back(service.name);
  }
  return changed;
}

}  // namespace

std::optional<std::string> runs_another_train(const fs::path& root, const Manifest& manifest) {
  const auto plan = HostFolder(root).plan();
  if (!plan || plan->down || plan->train_id == manifest.train_id) return std::nullopt;
  return "this computer runs train " + plan->train_id + "; " + manifest.folder.string() + " is of train " +
         manifest.train_id + ": railfix train down" + at_root(root) + " first, then railfix train up " +
         manifest.folder.string() + at_root(root);
}

bool any_runs(const HostFolder& folder) {
  return !running_on(folder, folder.state()).empty();
}

service::HealthAnswer health_of(const HostPlan& plan, const HostState& state, const std::string& service) {
  const auto process = state.find(service);
  if (process == state.end()) return {.text = "is not started"};
  if (process->second.pid == 0) {
    return {.text =
                "does not run: " + (process->second.last_end.empty() ? "not started yet" : process->second.last_end)};
  }
  service::CommonConfig common;
  common.train_id = plan.train_id;
  common.host = plan.host;
  return service::ask_health(process->second.beside ? service::health_path_beside(common, service)
                                                    : service::health_path(common, service));
}

std::string difference(const std::string& before, const std::string& after) {
  const auto lines = [](const std::string& text) {
    std::vector<std::string> list;
    std::istringstream in(text);
    for (std::string line; std::getline(in, line);) list.push_back(line);
    return list;
  };
  const auto old_lines = lines(before);
  const auto new_lines = lines(after);
  std::string text;
  for (const auto& line : old_lines) {
    if (std::find(new_lines.begin(), new_lines.end(), line) == new_lines.end()) text += "\n  -" + line;
  }
  for (const auto& line : new_lines) {
    if (std::find(old_lines.begin(), old_lines.end(), line) == old_lines.end()) text += "\n  +" + line;
  }
  return text;
}

core::Result<HostPlan> install(const Manifest& manifest, const TrainHost& host, const fs::path& root,
                               const std::map<std::string, TopicLayouts>& made_of) {
  const HostFolder folder(root);
  const auto now = folder.plan();
  HostPlan plan;
  plan.train_id = manifest.train_id;
  plan.host = host.name;
  plan.generation = folder.newest_generation() + 1;
  plan.previous = now && now->train_id == plan.train_id ? now->generation : 0;  // another train's is no way back
  const auto files = folder.generation(plan.generation);
  if (const auto rendered = render_host(manifest, host, files); !rendered.ok()) return rendered.error();
  bool all_same = true;
  for (const auto& service : services_on(manifest, host.name)) {
    PlannedService planned{service.name, service.release, plan.generation, service.standby, {}, {}, {}};
    planned.settings = settings_of(manifest, host, service.name);
    if (const auto commanded = set_commands(manifest, host, service, files, root, planned); !commanded.ok())
      return commanded.error();
    if (const auto found = made_of.find(service.name); found != made_of.end()) planned.made_of = found->second;
    const auto* runs = now ? now->service(service.name) : nullptr;
    const bool same = runs != nullptr && runs->release == planned.release && runs->standby == planned.standby &&
                      runs->settings == planned.settings;
    all_same = all_same && same;
    plan.services.push_back(same ? *runs : planned);
  }
  // Brought down and up again it is the same generation, and the way back is the same one.
  if (all_same && now && now->down && now->train_id == plan.train_id && now->services.size() == plan.services.size()) {
    std::error_code failed;
    fs::remove_all(files, failed);
    plan = *now;
    plan.down = false;
    return plan;
  }
  if (manifest.containers) {
    if (const auto handed = hand_over(folder.home()); !handed.ok()) return handed.error();
  }
  if (const auto written = folder.write_generation(plan); !written.ok()) return written.error();
  return plan;
}

core::Status bring_up(const fs::path& root, const HostPlan& plan, const HealthGate& gate, const Say& say) {
  const HostFolder folder(root);
  if (const auto written = folder.write(plan); !written.ok()) return written;
  if (!supervisor_of(folder)) {
    if (const auto started = start_supervisor(root); !started.ok()) return started;
  }
  const auto healthy = wait_healthy(folder, plan, names_of(plan), gate, say);
  if (healthy.ok()) folder.prune();
  return healthy;
}

core::Status bring_down(const fs::path& root) {
  const HostFolder folder(root);
  // First of all, so that a supervisor that systemd starts again keeps still.
  if (auto plan = folder.plan(); plan && !plan->down) {
    plan->down = true;
    if (const auto written = folder.write(*plan); !written.ok()) return written;
  }
  if (!supervisor_of(folder)) {
    if (!any_runs(folder)) return {};
    // Services whose supervisor has died end in order, too.
    if (const auto started = start_supervisor(root); !started.ok()) return started;
  }
  const auto pid = supervisor_of(folder);
  if (!pid) return core::Error{"the supervisor does not stay; why stands in " + folder.log("supervisor").string()};
  if (kill(static_cast<pid_t>(*pid), SIGTERM) != 0)
    return core::Error{"the supervisor " + std::to_string(*pid) + " cannot be told to end: " + std::strerror(errno)};
  if (!wait_until(kStopS, [&] { return supervisor_of(folder) != pid && !any_runs(folder); }))
    return core::Error{"the supervisor " + std::to_string(*pid) + " has not ended its services within " +
                       std::to_string(static_cast<int>(kStopS)) + " s"};
  return {};
}

// What another command has written meanwhile stays: `down` above all.
core::Status write_after(const HostFolder& folder, int last_generation, const HostPlan& next) {
  const auto there = folder.plan();
  if (there && there->down == next.down && there->generation == last_generation) return folder.write(next);
  return core::Error{
      "another command has changed what runs here meanwhile (railfix train down, upgrade or rollback); this one has "
      "stopped, railfix train status says what runs"};
}

core::Status roll_out(const fs::path& root, const HostPlan& plan, const HealthGate& gate, const Say& say) {
  const HostFolder folder(root);
  const auto before = folder.plan();
  if (!before) return core::Error{"no train was brought up here; begin with railfix train up TRAIN"};
  // While one after the other is swapped they have to hear each other.
  if (const auto found = misfit(plan.services, before->services)) return core::Error{*found + kNotTogether};
  auto now = *before;
  now.generation = plan.generation;
  now.previous = plan.previous;  // after a rollback the one before that one, and not what was rolled back from
  int there = before->generation;
  const auto changed = changed_services(*before, plan);
  for (const auto& name : changed) {
    const bool sent = health_of(now, folder.state(), name).sends;
    now = with_service(now, plan, name);
    if (const auto written = write_after(folder, there, now); !written.ok()) return written;
    there = now.generation;
    const auto* target = plan.service(name);
    say(target != nullptr ? name + ": release " + target->release + ", generation " + std::to_string(target->generation)
                          : name + ": leaves this host");
    if (target == nullptr) continue;
    const auto healthy = wait_healthy(folder, now, {name}, gate, say, sent);
    if (healthy.ok()) continue;
    say(healthy.error().message + "; back to generation " + std::to_string(before->generation));
    if (const auto written = write_after(folder, there, *before); !written.ok()) return written;
    const HealthGate patient{gate.healthy_s, std::max(gate.patience_s, kBackS)};
    const auto again = wait_healthy(folder, *before, names_of(*before), patient, say);
    return core::Error{"generation " + std::to_string(plan.generation) + " did not pass: " + healthy.error().message +
                       (again.ok() ? "; generation " + std::to_string(before->generation) + " runs again"
                                   : "; AND the old generation is not healthy: " + again.error().message)};
  }
  if (const auto written = write_after(folder, there, now); !written.ok()) return written;
  folder.prune();
  // An upgrade that was broken off may have left one that does not run.
  auto others = names_of(now);
  std::erase_if(others, [&](const auto& name) { return std::ranges::find(changed, name) != changed.end(); });
  if (const auto healthy = wait_healthy(folder, now, others, gate, say); !healthy.ok())
    return core::Error{"generation " + std::to_string(now.generation) + " runs, but " + healthy.error().message};
  return {};
}

}  // namespace railfix::tool
