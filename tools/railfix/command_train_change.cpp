// `railfix train up`, `down`, `upgrade` and `rollback`.
#include <csignal>
#include <iostream>

#include "command_train.hpp"
#include "core/result.hpp"
#include "train/command_lock.hpp"
#include "train/supervise.hpp"

namespace railfix::tool {
namespace {

HostPlan running_plan_here(const TrainOptions& options) {
  auto plan = plan_here(options);
  if (plan.down)
    throw core::BadInput("the train is down; railfix train up " + plan.train() + at_root(options.root) +
                         " starts it as the manifest says");
  // Nobody would start what the plan says, and the new generation would be blamed.
  if (!supervisor_of(HostFolder(options.root)))
    throw core::BadInput("no supervisor runs here; railfix train up " + plan.train() + at_root(options.root) +
                         " starts it");
  return plan;
}

void say_at_once(const std::string& text) {
  std::cout << text << std::endl;
}

volatile std::sig_atomic_t ended_by = 0;

/// From now on Ctrl-C ends the work where it can be told how far it has come. A connection that drops must not leave it
/// half done.
void heed_signals(HealthGate& gate) {
  std::signal(SIGHUP, SIG_IGN);
  for (const int signal : {SIGINT, SIGTERM}) std::signal(signal, [](int which) { ended_by = which; });
  gate.is_interrupted = [] { return ended_by != 0; };
}

struct Way {
  std::string on;
  std::string back;
};

/// The exit code: as of a program that the signal has ended.
int say_interrupted(const TrainOptions& options, const HostPlan& before, const HostPlan& target, const Way& way) {
  const HostFolder folder(options.root);
  const auto now = folder.plan();
  const auto parts = half_done(folder, before, target);
  if (!parts) {
    std::cerr << "railfix: interrupted; generation " << before.generation << " runs as before\n";
  } else if (now && unfinished(folder, *now) != Unfinished::nothing) {
    std::cerr << "railfix: interrupted, half done\n  " << *parts << "\n  to go on:   " << way.on
              << "\n  to go back: " << way.back << '\n';
  } else {
    std::cerr << "railfix: interrupted before it was known whether it is healthy; railfix train status"
              << at_root(options.root) << " says it\n  " << *parts << "\n  to go back: " << way.back << '\n';
  }
  return 128 + ended_by;
}

}  // namespace

int train_up(const TrainOptions& options) {
  const HostFolder folder(options.root);
  core::ok_or_throw(folder.may_be_changed());
  const CommandLock alone(folder, "up");
  const auto as_of = folder.plan_written();
  const auto manifest = core::value_or_throw(read_manifest(options.train));
  refuse_another_train(options, manifest);
  const auto& host = chosen_host(manifest, options);
  auto [findings, made_of] = checked(manifest, options);
  for (auto& finding : check_computer(&manifest, &host, options.root)) findings.push_back(std::move(finding));
  if (!say(findings)) return 1;
  const auto installed = folder.plan();
  const bool supervised = supervisor_of(folder).has_value();
  const bool runs = installed && !installed->down && (supervised || any_runs(folder));
  if (runs) {
    std::cout << "services run here already" << (supervised ? "" : ", without a supervisor: it is started")
              << "; railfix train diff " << manifest.typed()
              << " says what the manifest would change, upgrade does it\n";
    if (supervised) return say_status(options);
  }
  const auto plan = runs ? *installed : core::value_or_throw(install(manifest, host, options.root, made_of));
  const auto healthy = bring_up(options.root, plan, as_of, options.gate, say_at_once);
  if (!healthy.ok()) std::cerr << "railfix: not healthy: " << healthy.error().message << '\n';
  const int shown = say_status(options);
  return healthy.ok() ? shown : 1;
}

int train_down(const TrainOptions& options) {
  const HostFolder folder(options.root);
  core::ok_or_throw(folder.may_be_changed());
  const auto plan = plan_here(options);
  const DownLock alone(folder);
  core::ok_or_throw(bring_down(options.root));
  std::cout << "train " << plan.train_id << ", host " << plan.host << ": stopped\n";
  return 0;
}

int train_upgrade(const TrainOptions& options) {
  const HostFolder folder(options.root);
  core::ok_or_throw(folder.may_be_changed());
  const CommandLock alone(folder, "upgrade");
  const auto manifest = core::value_or_throw(read_manifest(options.train));
  refuse_another_train(options, manifest);
  const auto& host = chosen_host(manifest, options);
  const auto before = running_plan_here(options);
  auto [findings, made_of] = checked(manifest, options);
  for (auto& finding : check_computer(&manifest, &host, options.root)) findings.push_back(std::move(finding));
  if (!say(findings)) return 1;
  const auto plan = core::value_or_throw(install(manifest, host, options.root, made_of));
  auto gate = options.gate;
  heed_signals(gate);
  const auto done = roll_out(options.root, plan, gate, say_at_once);
  if (!done.ok() && ended_by != 0)
    return say_interrupted(options, before, plan,
                           {"railfix train upgrade " + manifest.typed() + at_root(options.root),
                            "railfix train rollback" + at_root(options.root)});
  if (!done.ok()) throw std::runtime_error(done.error().message);
  std::cout << "generation " << plan.generation << " runs\n";
  return 0;
}

int train_rollback(const TrainOptions& options) {
  const HostFolder folder(options.root);
  core::ok_or_throw(folder.may_be_changed());
  const CommandLock alone(folder, "rollback");
  const auto now = running_plan_here(options);
  // One that was interrupted comes to its end before another one goes further back.
  const int number = unfinished(folder, now) == Unfinished::rollback ? now.generation : now.previous;
  const auto before = folder.plan(number);
  if (number == 0 || !before)
    throw core::BadInput("there is no generation before " + std::to_string(now.generation) +
                         "; railfix train upgrade " + now.train() + at_root(options.root) +
                         " brings what train.yaml says");
  auto gate = options.gate;
  heed_signals(gate);
  const auto done = roll_out(options.root, *before, gate, say_at_once);
  if (!done.ok() && ended_by != 0)
    return say_interrupted(options, now, *before,
                           {"railfix train rollback" + at_root(options.root),
                            "railfix train upgrade " + now.train() + at_root(options.root)});
  if (!done.ok()) throw std::runtime_error(done.error().message);
  std::cout << "generation " << before->generation << " runs again\n";
  return 0;
}

}  // namespace railfix::tool
