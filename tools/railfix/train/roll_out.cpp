#include "train/roll_out.hpp"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <unistd.h>

#include <algorithm>
#include <cstring>
#include <sstream>

#include "core/time.hpp"
#include "train/command_lock.hpp"
#include "train/log_file.hpp"
#include "train/made_of.hpp"
#include "train/render.hpp"
#include "train/running.hpp"
#include "train/supervise.hpp"

namespace railfix::tool {
namespace {

namespace fs = std::filesystem;

constexpr double kStopS = 40;
constexpr double kPlanLockS = 5;  // then without: a command that was stopped with Ctrl-Z must not keep `down` off
constexpr double kBackS = 60;
constexpr const char* kNotTogether =
    ", which runs here: they would not hear each other; railfix train down on every host, then up";

// A process of its own session, so that it stays when the terminal goes.
core::Status start_supervisor(const fs::path& root) {
  const HostFolder folder(root);
  const auto program = fs::read_symlink("/proc/self/exe").string();
  const auto log_file = folder.log("supervisor");
  const int log = open_log(log_file);
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

std::string still_there(const HostFolder& folder) {
  std::string text;
  for (const auto& [key, running] : running_on(folder, folder.state()))
    text +=
        (text.empty() ? "; still there: " : ", ") + service_of(key) + " (process " + std::to_string(running.pid) + ")";
  return text;
}

// That nothing is to run here.
core::Status write_down(const HostFolder& folder) {
  const FileLock alone(folder.plan_lock(), kPlanLockS);
  auto plan = folder.plan();
  if (!plan) return {};
  plan->down = true;
  return folder.write(*plan);
}

// And their supervisor.
core::Status end_services(const fs::path& root) {
  const HostFolder folder(root);
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
                       std::to_string(static_cast<int>(kStopS)) + " s" + still_there(folder) + "; why stands in " +
                       folder.log("supervisor").string() + ", or in systemd's journal"};
  return {};
}

}  // namespace

std::optional<std::string> runs_another_train(const fs::path& root, const Manifest& manifest) {
  const auto plan = HostFolder(root).plan();
  if (!plan || plan->down || plan->train_id == manifest.train_id) return std::nullopt;
  return "this computer runs train " + plan->train_id + "; " + manifest.folder.string() + " is of train " +
         manifest.train_id + ": railfix train down" + at_root(root) + " first, then railfix train up " +
         manifest.typed() + at_root(root);
}

bool any_runs(const HostFolder& folder) {
  return !running_on(folder, folder.state()).empty();
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

Unfinished unfinished(const HostFolder& folder, const HostPlan& now) {
  const auto whole = folder.plan(now.generation);
  if (!whole || changed_services(now, *whole).empty()) return Unfinished::nothing;
  const bool goes_back =
      std::ranges::any_of(now.services, [&](const auto& service) { return service.generation > now.generation; });
  return goes_back ? Unfinished::rollback : Unfinished::upgrade;
}

std::optional<std::string> half_done(const HostFolder& folder, const HostPlan& before, const HostPlan& target) {
  const auto now = folder.plan().value_or(before);
  const auto state = folder.state();
  std::string done;
  std::string not_done;
  for (const auto& name : changed_services(before, target)) {
    const auto* service = now.service(name);
    const auto* wanted = target.service(name);
    const bool is_done = wanted == nullptr ? service == nullptr : service != nullptr && *service == *wanted;
    auto& list = is_done ? done : not_done;
    list += (list.empty() ? "" : ", ") + name;
    if (service == nullptr) {
      list += is_done ? " (has left this host)" : " (not here yet)";
      continue;
    }
    list += " (release " + service->release;
    const auto runs = state.find(name);
    const bool is_up = runs != state.end() && runs->second.generation == service->generation && !runs->second.beside &&
                       health_of(now, state, name).healthy;
    list += is_up ? ")" : ", not up yet)";
  }
  if (done.empty()) return std::nullopt;
  const std::string still = "\n  still generation " + std::to_string(before.generation) + ": " + not_done;
  return "already generation " + std::to_string(target.generation) + ": " + done + (not_done.empty() ? "" : still);
}

core::Result<HostPlan> install(const Manifest& manifest, const TrainHost& host, const fs::path& root,
                               const std::map<std::string, TopicLayouts>& made_of) {
  const HostFolder folder(root);
  const auto now = folder.plan();
  HostPlan plan;
  plan.train_id = manifest.train_id;
  plan.host = host.name;
  plan.train_folder = (fs::absolute(manifest.folder) / "").lexically_normal().parent_path().string();
  plan.generation = folder.newest_generation() + 1;
  // Another train's is no way back, and nothing is one that never ran whole.
  if (now && now->train_id == plan.train_id)
    plan.previous = unfinished(folder, *now) == Unfinished::upgrade ? now->previous : now->generation;
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
    const auto from = plan.train_folder;
    plan = *now;
    plan.down = false;
    plan.train_folder = from;
    return plan;
  }
  if (manifest.containers) {
    if (const auto handed = hand_over(folder.home()); !handed.ok()) return handed.error();
  }
  if (const auto written = folder.write_generation(plan); !written.ok()) return written.error();
  return plan;
}

core::Status bring_up(const fs::path& root, const HostPlan& plan, fs::file_time_type as_of, const HealthGate& gate,
                      const Say& say) {
  const HostFolder folder(root);
  {
    const FileLock alone(folder.plan_lock(), kPlanLockS);
    if (folder.plan_written() != as_of) return core::Error{kChangedMeanwhile};
    if (const auto written = folder.write(plan); !written.ok()) return written;
  }
  if (!supervisor_of(folder)) {
    if (const auto started = start_supervisor(root); !started.ok()) return started;
  }
  const auto waited = wait_healthy(folder, plan, names_of(plan), gate, say);
  if (waited.healthy.ok()) folder.prune();
  return waited.healthy;
}

core::Status bring_down(const fs::path& root) {
  const HostFolder folder(root);
  // First of all, so that a supervisor that systemd starts again keeps still. Written in any case: who is about to
  // bring the train up sees by it that it was taken down meanwhile.
  const auto first = write_down(folder);
  const auto ended = end_services(root);
  if (first.ok()) return ended;
  // On a full disk the recorder may have been what filled it.
  const auto again = write_down(folder);
  if (again.ok()) return ended;
  return core::Error{(ended.ok() ? "the services are stopped, but " : ended.error().message + "; and ") +
                     again.error().message +
                     "; systemd or a restart of the computer brings the train up again until that is mended and "
                     "railfix train down" +
                     at_root(root) + " is typed once more"};
}

// What another command has written meanwhile stays: `down` above all.
core::Status write_after(const HostFolder& folder, int last_generation, const HostPlan& next) {
  const FileLock alone(folder.plan_lock(), kPlanLockS);
  const auto there = folder.plan();
  if (there && there->down == next.down && there->generation == last_generation) return folder.write(next);
  return core::Error{kChangedMeanwhile};
}

core::Status roll_out(const fs::path& root, const HostPlan& plan, const HealthGate& gate, const Say& say) {
  const HostFolder folder(root);
  const auto before = folder.plan();
  if (!before) return core::Error{"no train was brought up here; begin with railfix train up TRAIN"};
  // While one after the other is swapped they have to hear each other.
  if (const auto found = misfit(plan.services, before->services)) return core::Error{*found + kNotTogether};
  auto now = *before;
  now.generation = plan.generation;
  now.train_folder = plan.train_folder;
  now.previous = plan.previous;  // after a rollback the one before that one, and not what was rolled back from
  int there = before->generation;
  const auto changed = changed_services(*before, plan);
  for (const auto& name : changed) {
    if (gate.is_interrupted()) return core::Error{"interrupted"};
    const bool sent = health_of(now, folder.state(), name).sends;
    now = with_service(now, plan, name);
    if (const auto written = write_after(folder, there, now); !written.ok()) return written;
    there = now.generation;
    const auto* target = plan.service(name);
    say(target != nullptr ? name + ": release " + target->release + ", generation " + std::to_string(target->generation)
                          : name + ": leaves this host");
    if (target == nullptr) continue;
    const auto [healthy, broken_off] = wait_healthy(folder, now, {name}, gate, say, sent);
    if (healthy.ok()) continue;
    if (broken_off) return healthy;
    say(healthy.error().message + "; back to generation " + std::to_string(before->generation));
    if (const auto written = write_after(folder, there, *before); !written.ok()) return written;
    const HealthGate patient{gate.healthy_s, std::max(gate.patience_s, kBackS), gate.is_interrupted};
    const auto again = wait_healthy(folder, *before, names_of(*before), patient, say).healthy;
    return core::Error{"generation " + std::to_string(plan.generation) + " did not pass: " + healthy.error().message +
                       (again.ok() ? "; generation " + std::to_string(before->generation) + " runs again"
                                   : "; AND the old generation is not healthy: " + again.error().message)};
  }
  if (const auto written = write_after(folder, there, now); !written.ok()) return written;
  folder.prune();
  // An upgrade that was broken off may have left one that does not run.
  auto others = names_of(now);
  std::erase_if(others, [&](const auto& name) { return std::ranges::find(changed, name) != changed.end(); });
  if (const auto healthy = wait_healthy(folder, now, others, gate, say).healthy; !healthy.ok())
    return core::Error{"generation " + std::to_string(now.generation) + " runs, but " + healthy.error().message};
  return {};
}

}  // namespace railfix::tool
