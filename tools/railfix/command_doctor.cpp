// `railfix doctor`: a computer as a host of a train (docs/fleet.md).
#include <iostream>

#include "command_train.hpp"
#include "commands.hpp"
#include "core/result.hpp"
#include "train/supervise.hpp"

namespace railfix::tool {

namespace {

/// What the services that run on this computer complain of.
std::vector<Finding> check_services(const TrainOptions& options) {
  const HostFolder folder(options.root);
  std::vector<Finding> findings;
  const auto plan = folder.plan();
  if (!plan || plan->down) return findings;
  if (!supervisor_of(folder)) {
    const auto starts = "railfix train up " + plan->train() + at_root(options.root) + " starts it";
    findings.push_back({true, any_runs(folder) ? "services run without a supervisor: " + starts
                                               : "train " + plan->train_id +
                                                     " does not run here, neither its services nor their "
                                                     "supervisor, and nobody has taken it down: " +
                                                     starts});
    return findings;
  }
  for (const auto& service : plan->services) {
    const auto health = health_of(*plan, folder.state(), service.name);
    if (!health.works() || health.degraded) findings.push_back({!health.works(), service.name + " " + health.text});
  }
  return findings;
}

int doctor(const TrainOptions& options) {
  const TrainHost* host = nullptr;
  Manifest manifest;
  if (!options.train.empty()) {
    manifest = core::value_or_throw(read_manifest(options.train));
    host = &chosen_host(manifest, options);
  }
  auto findings = check_computer(host == nullptr ? nullptr : &manifest, host, options.root);
  if (host != nullptr) {
    for (auto& finding : check_certificates(manifest, *host)) findings.push_back(std::move(finding));
  }
  for (auto& finding : check_installed_certificates(HostFolder(options.root))) findings.push_back(std::move(finding));
  for (auto& finding : check_services(options)) findings.push_back(std::move(finding));
  const bool good = say(findings);
  const std::string no_manifest =
      " (looked at as any host: its address, releases, map and keys only with --train TRAIN)";
  std::cout << (good ? "this computer can run Railfix" : "this computer must not run Railfix like this")
            << (host == nullptr ? no_manifest : "") << '\n';
  return good ? 0 : 1;
}

}  // namespace

void add_doctor(CLI::App& app, Action& chosen) {
  auto options = std::make_shared<TrainOptions>();
  auto* computer = app.add_subcommand("doctor", "Say what is wrong with this computer as a host of a train");
  computer->footer("Example: railfix doctor --train deploy/trains/re460-042 --host cab");
  computer->add_option("--train", options->train, "Folder of train.yaml");
  computer->add_option("--host", options->host, "Which host of the train this computer is");
  computer->add_option("--root", options->root, "Where var/lib/railfix is")->check(no_file())->capture_default_str();
  computer->callback([&chosen, options] { chosen = [options] { return doctor(*options); }; });
}

}  // namespace railfix::tool
