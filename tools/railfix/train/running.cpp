#include "train/running.hpp"

#include <algorithm>
#include <set>

#include "train/stands_still.hpp"

namespace railfix::tool {
namespace {

namespace fs = std::filesystem;

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

/// The younger of two has the name.
void add(HostState& all, const std::string& name, const RunningService& one) {
  const auto there = all.find(name);
  if (there == all.end()) {
    all.emplace(name, one);
  } else if (there->second.born <= one.born) {
    all[name + kBefore] = there->second;
    all[name] = one;
  } else {
    all[name + kBefore] = one;
  }
}

}  // namespace

std::vector<std::string> usual_command(std::vector<std::string> command) {
  if (!command.empty() && command.back() == kBeside) command.pop_back();
  return command;
}

HostState running_on(const HostFolder& folder, const HostState& noted) {
  HostState all;
  std::set<int64_t> pids;
  for (const auto& [name, service] : noted) {
    if (!service.runs()) continue;
    all.emplace(name, service);
    pids.insert(service.pid);
  }
  const auto known = known_services(folder);
  std::error_code none;
  for (const auto& process : fs::directory_iterator("/proc", none)) {
    const auto pid = static_cast<pid_t>(std::atoll(process.path().filename().c_str()));
    if (pid <= 0 || pids.contains(pid)) continue;
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
    if (found.runs()) add(all, is->name, found);
  }
  return all;
}

}  // namespace railfix::tool
