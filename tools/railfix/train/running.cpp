#include "train/running.hpp"

#include <algorithm>
#include <set>

#include "train/stands_still.hpp"

namespace railfix::tool {
namespace {

constexpr const char* kBeside = "--beside";

/// Every command that this host may have started.
std::vector<PlannedService> known_services(const HostFolder& folder) {
  std::vector<PlannedService> known;
  for (int number = folder.newest_generation(); number >= 0; --number) {
    try {
      const auto plan = number == 0 ? folder.plan() : folder.plan(number);
      if (plan) known.insert(known.end(), plan->services.begin(), plan->services.end());
    } catch (const core::BadInput&) {  // told by who needs this file
    }
  }
  return known;
}

using Processes = std::map<std::string, std::vector<RunningService>>;

/// The oldest knows most; the youngest may be there to succeed it.
HostState in_their_places(Processes processes) {
  HostState all;
  for (auto& [name, of_one] : processes) {
    std::ranges::sort(of_one, {}, &RunningService::born);
    const bool succeeded = of_one.size() > 1 && of_one.back().beside;
    for (size_t i = 0; i < of_one.size(); ++i) {
      const bool has_name = i == (succeeded ? of_one.size() - 1 : 0);
      const bool is_succeeded = succeeded && i == 0;
      const std::string place = has_name ? "" : is_succeeded ? kBefore : kTooMany + std::to_string(of_one[i].pid);
      all[name + place] = of_one[i];
    }
  }
  return all;
}

}  // namespace

std::vector<std::string> usual_command(std::vector<std::string> command) {
  if (!command.empty() && command.back() == kBeside) command.pop_back();
  return command;
}

std::string service_of(const std::string& key) {
  return key.substr(0, key.find(' '));
}

HostState running_on(const HostFolder& folder, const HostState& noted) {
  Processes processes;
  std::set<int64_t> pids;
  for (const auto& [key, service] : noted) {
    if (service.runs() && pids.insert(service.pid).second) processes[service_of(key)].push_back(service);
  }
  const auto known = known_services(folder);
  for (const pid_t pid : tool::processes()) {
    if (pids.contains(pid)) continue;
    const auto command = command_of(pid);
    const auto usual = usual_command(command);
    const auto is = std::ranges::find(known, usual, &PlannedService::command);
    if (command.empty() || is == known.end()) continue;
    if (command_of(parent_of(pid)) == command) continue;  // an engine that has started itself once more
    RunningService found;
    found.pid = pid;
    found.generation = is->generation;
    found.beside = usual != command;
    found.born = born_of(pid);
    if (found.runs()) processes[is->name].push_back(found);
  }
  return in_their_places(std::move(processes));
}

}  // namespace railfix::tool
