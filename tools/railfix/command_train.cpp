// `railfix train`: a train from its manifest (docs/fleet.md).
#include <cstdio>
#include <filesystem>
#include <iostream>
#include <nlohmann/json.hpp>

#include "command_train.hpp"
#include "commands.hpp"
#include "core/joined.hpp"
#include "core/json_text.hpp"
#include "core/result.hpp"
#include "number_between.hpp"
#include "train/check.hpp"
#include "train/render.hpp"
#include "train/supervise.hpp"
#include "train/verdict.hpp"

namespace railfix::tool {

namespace fs = std::filesystem;

/// Prints what was found; false when one of it is an error.
bool say(const std::vector<Finding>& findings) {
  bool good = true;
  for (const auto& finding : findings) {
    std::cout << (finding.error ? "error: " : "warning: ") << finding.text << '\n';
    good = good && !finding.error;
  }
  return good;
}

CLI::Validator no_file() {
  return {[](const std::string& name) {
            return fs::exists(name) && !fs::is_directory(name) ? name + " is a file; give a folder" : std::string();
          },
          ""};
}

TrainCheck checked(const Manifest& manifest, const TrainOptions& options) {
  return check_train(manifest, [&](const HostedService& service) { return program_of(service, options.root); });
}

std::string names_of(const Manifest& manifest) {
  return core::joined(manifest.hosts, &TrainHost::name);
}

const TrainHost& chosen_host(const Manifest& manifest, const TrainOptions& options) {
  const auto* host = options.host.empty() ? manifest.host_here() : manifest.host(options.host);
  if (host != nullptr) return *host;
  if (!options.host.empty())
    throw core::BadInput("--host '" + options.host + "' is no host of train " + manifest.train_id +
                         "; there are: " + names_of(manifest));
  throw core::BadInput(manifest.why_no_host_here());
}

HostPlan plan_here(const TrainOptions& options) {
  auto plan = HostFolder(options.root).plan();
  if (!plan) throw core::BadInput("no train was brought up on this computer; begin with railfix train up TRAIN");
  return *plan;
}

void refuse_another_train(const TrainOptions& options, const Manifest& manifest) {
  if (const auto why = runs_another_train(options.root, manifest)) throw core::BadInput(*why);
}

nlohmann::ordered_json status_json(const PlannedService& service, const RunningService& process,
                                   const service::HealthAnswer& health) {
  return {{"service", service.name},
          {"release", service.release},
          {"generation", service.generation},
          {"standby", service.standby},
          {"pid", process.pid},
          {"restarts", process.restarts},
          {"healthy", health.works()},
          {"stands_by", health.stands_by},
          {"text", health.text}};
}

std::string status_row(const PlannedService& service, const RunningService& process,
                       const service::HealthAnswer& health) {
  char row[256];
  std::snprintf(row, sizeof(row), "%-15s %-10s %10d %8lld %8d  ", service.name.c_str(), service.release.c_str(),
                service.generation, static_cast<long long>(process.pid), process.restarts);
  return row + health.text + standby_text(service, health) + "\n";
}

int say_status(const TrainOptions& options) {
  const HostFolder folder(options.root);
  const auto plan = plan_here(options);
  const auto state = folder.state();
  const auto supervisor = supervisor_of(folder);
  const bool runs = supervisor || any_runs(folder);
  bool healthy = supervisor.has_value();
  nlohmann::ordered_json json{{"train", plan.train_id},
                              {"host", plan.host},
                              {"generation", plan.generation},
                              {"supervised", supervisor.has_value()},
                              {"down", plan.down},
                              {"services", nlohmann::ordered_json::array()}};
  std::string table;
  Answers answers;
  std::string page;  // another port than the configured one, when that was taken
  for (const auto& service : plan.services) {
    const auto found = state.find(service.name);
    const RunningService process = found == state.end() || !runs ? RunningService{} : found->second;
    const auto health = health_of(plan, runs ? state : HostState{}, service.name);
    healthy = healthy && health.works();
    answers[service.name] = health;
    page += health.serves;
    json["services"].push_back(status_json(service, process, health));
    table += status_row(service, process, health);
  }
  if (!page.empty()) json["page"] = page;
  const auto again = "railfix train up " + plan.train() + at_root(options.root);
  if (options.json) {
    std::cout << core::json_text(json, 2) << '\n';
  } else {
    std::cout << "train " << plan.train_id << ", host " << plan.host << ", generation " << plan.generation
              << (plan.down    ? ", down: " + again
                  : supervisor ? std::string()
                  : runs       ? ", without supervisor: " + again
                               : ", not running: " + again)
              << "\n"
              << "service         release    generation      pid restarts  health\n"
              << table << (page.empty() ? "" : "the page is at " + page + "\n");
    for (const auto& sentence : deaf_services(answers)) std::cout << sentence << '\n';
    if (const auto others = not_seen_from_here(folder, plan); runs && !others.empty()) std::cout << others << '\n';
  }
  return healthy ? 0 : 1;
}

namespace {

// Nothing is asked over the network: each computer knows its own clock, disks, memory and images best.
void say_not_asked(const Manifest& manifest, const TrainHost* here) {
  if (here == nullptr)
    std::cout << "not asked: this computer, which is no host: " << manifest.why_no_host_here() << '\n';
  for (const auto& host : manifest.hosts) {
    if (here != nullptr && host.name == here->name) continue;
    std::cout << "not asked: the computer " << host.name << " (clock, memory, disks, network, releases); type railfix "
              << "train check there, too: ssh " << host.address << " railfix train check TRAIN\n";
  }
}

int check(const TrainOptions& options) {
  const auto manifest = core::value_or_throw(read_manifest(options.train));
  auto findings = checked(manifest, options).findings;
  const auto* here = options.host.empty() ? manifest.host_here() : &chosen_host(manifest, options);
  if (here != nullptr) {
    for (auto& finding : check_computer(&manifest, here, options.root)) findings.push_back(std::move(finding));
    if (const auto why = runs_another_train(options.root, manifest)) findings.push_back({true, *why});
  }
  const bool good = say(findings);
  say_not_asked(manifest, here);
  std::cout << "train " << manifest.train_id << ": " << manifest.services.size() << " services on "
            << manifest.hosts.size() << (manifest.hosts.size() == 1 ? " host" : " hosts") << ", release "
            << manifest.release
            << (!good             ? ", must not start like this"
                : here == nullptr ? ", the manifest has no error; no computer was looked at"
                                  : ", can start")
            << '\n';
  return good ? 0 : 1;
}

/// The folders of the hosts would lie among what they are made of, and be removed with the keys of others.
void refuse_own_folder(const Manifest& manifest, const fs::path& out) {
  if (out.empty()) throw core::BadInput("--out is missing: name the folder to write into");
  std::error_code none;
  for (const auto& own : {manifest.folder, manifest.folder / "security"}) {
    if (fs::equivalent(out, own, none))
      throw core::BadInput("--out " + out.string() + " is the train's own folder; name another one");
  }
}

int render(const TrainOptions& options) {
  const auto manifest = core::value_or_throw(read_manifest(options.train));
  refuse_own_folder(manifest, options.out);
  if (!say(checked(manifest, options).findings)) return 1;
  for (const auto& other : remove_secrets_of_others(manifest, options.out))
    std::cout << other.string() << ": is of no host of train " << manifest.train_id << "; its keys are removed\n";
  for (const auto& host : manifest.hosts) {
    core::ok_or_throw(render_host(manifest, host, options.out / host.name));
    std::cout << host.name << " (" << host.address << "): " << (options.out / host.name).string() << '\n';
  }
  return 0;
}

int keys(const TrainOptions& options) {
  const auto manifest = core::value_or_throw(read_manifest(options.train));
  const auto done = core::value_or_throw(make_keys(manifest, options.keys));
  for (const auto& line : told_of_keys(manifest, options.keys, done)) std::cout << line << '\n';
  return 0;
}

int diff(const TrainOptions& options) {
  const auto manifest = core::value_or_throw(read_manifest(options.train));
  refuse_another_train(options, manifest);
  const auto& host = chosen_host(manifest, options);
  const auto now = plan_here(options);
  if (now.train_id != manifest.train_id)
    throw core::BadInput("train " + now.train_id + " was here before, and is down; railfix train up " +
                         manifest.typed() + at_root(options.root) + " starts " + manifest.train_id);
  size_t changes = 0;
  for (const auto& service : services_on(manifest, host.name)) {
    const auto* runs = now.service(service.name);
    std::string text;
    if (runs == nullptr) {
      text = "comes to this host";
    } else if (runs->release != service.release) {
      text = "release " + runs->release + " -> " + service.release;
    } else if (runs->standby != service.standby) {
      text = service.standby ? "becomes standby" : "is standby no more";
    } else {
      text = difference(runs->settings, settings_of(manifest, host, service.name));
    }
    if (text.empty()) continue;
    ++changes;
    std::cout << service.name << ": " << text << '\n';
  }
  for (const auto& service : now.services) {
    const auto* stays = manifest.service(service.name);
    if (stays != nullptr && (stays->host == host.name || stays->standby == host.name)) continue;
    ++changes;
    std::cout << service.name << ": leaves this host\n";
  }
  std::cout << (changes == 0 ? "nothing to be done"
                             : "railfix train upgrade " + manifest.typed() + at_root(options.root) +
                                   " does it, service by service")
            << '\n';
  return 0;
}

int supervise_here(const TrainOptions& options) {
  supervise(HostFolder(options.root));
  return 0;
}

}  // namespace

void add_train(CLI::App& app, Action& chosen) {
  auto options = std::make_shared<TrainOptions>();
  auto* train = app.add_subcommand(
      "train", "A train as a whole, from its manifest.  Example: railfix train check deploy/trains/re460-042");
  train->require_subcommand(1);
  enum { kManifest = 1, kHost = 2, kRoot = 4, kGate = 8 };
  const auto add = [&](const char* name, const char* what, int (*work)(const TrainOptions&), int takes) {
    auto* command = train->add_subcommand(name, what);
    if ((takes & kManifest) != 0) command->add_option("train", options->train, "Folder of train.yaml")->required();
    if ((takes & kHost) != 0)
      command->add_option("--host", options->host,
                          "Which host of the train this computer is; found by its address otherwise");
    if ((takes & kRoot) != 0)
      command->add_option("--root", options->root, "Where var/lib/railfix and opt/railfix are")
          ->check(no_file())
          ->capture_default_str();
    if ((takes & kGate) != 0) {
      command->add_option("--healthy-for", options->gate.healthy_s, "Seconds that a service must be healthy")
          ->check(number_between(0.5, 600.0))
          ->capture_default_str();
      command->add_option("--patience", options->gate.patience_s, "Seconds that it may take to become so")
          ->check(number_between(1.0, 3600.0))
          ->capture_default_str();
    }
    command->callback([&chosen, options, work] { chosen = [options, work] { return work(*options); }; });
    return command;
  };
  add("check", "Say everything that would go wrong, before anything starts", check, kManifest | kHost | kRoot);
  add("render", "Write configuration, compose file and systemd unit for each host", render, kManifest)
      ->add_option("--out", options->out, "Folder to write into")
      ->required();
  auto* make = add("keys", "Make the train's certificates and permissions for DDS Security", keys, kManifest);
  make->add_option("--days", options->keys.valid_days, "How long certificates are valid")
      ->check(CLI::Range(1, 3650))
      ->capture_default_str();
  auto* renew = make->add_flag("--renew", options->keys.renew,
                               "Make new ones although there are some, by the next authority if there is one; the old "
                               "ones stay valid");
  auto* next = make->add_flag("--next-authority", options->keys.next_authority,
                              "Make a second authority, which every host trusts beside the first one");
  auto* drop = make->add_flag("--drop-authority", options->keys.drop_authority, "Trust the former authority no more");
  next->excludes(renew)->excludes(drop);
  drop->excludes(renew);
  add("up", "Check, then start this computer's services and a supervisor that keeps them running", train_up,
      kManifest | kHost | kRoot | kGate);
  add("down", "Stop this computer's services and their supervisor", train_down, kRoot);
  add("status", "How this computer's services are: exit code 0 when all are healthy", say_status, kRoot)
      ->add_flag("--json", options->json, "JSON on standard output");
  add("diff", "What upgrade would change on this computer", diff, kManifest | kHost | kRoot);
  add("upgrade",
      "Bring this computer to the manifest, service by service; back by itself when one does not get healthy",
      train_upgrade, kManifest | kHost | kRoot | kGate);
  add("rollback", "Back to the generation before; once more: further back", train_rollback, kRoot | kGate);
  add("supervise", "Keep this computer's services running; what systemd starts", supervise_here, kRoot);
}

}  // namespace railfix::tool
