#include "train/plan.hpp"

#include <unistd.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cerrno>
#include <fstream>
#include <set>

#include "core/shell_word.hpp"
#include "core/whole_file.hpp"
#include "service/yaml_file.hpp"
#include "train/stands_still.hpp"
#include "train/whole_folder.hpp"

namespace railfix::tool {
namespace {

namespace fs = std::filesystem;

constexpr int kGenerationsKept = 5;
constexpr const char* kBoot = "boot_id";  // in state.yaml, beside the services

core::BadInput damaged(const fs::path& file, const std::string& how) {
  return core::BadInput(file.string() + " is damaged (" + how + "); remove it, then railfix train up TRAIN");
}

// What `read` makes of a file of ours; nothing when it is not there.
template <class Read>
auto load(const fs::path& file, Read read) -> std::optional<decltype(read(YAML::Node()))> {
  try {
    return read(service::load_yaml(file));
  } catch (const YAML::BadFile&) {
    return std::nullopt;
  } catch (const YAML::Exception& error) {
    throw damaged(file, error.what());
  }
}

void require(bool holds, const YAML::Node& node, const char* what) {
  if (!holds) throw YAML::RepresentationException(node.Mark(), what);
}

PlannedService service_of(const YAML::Node& node) {
  require(node["command"].IsSequence() && node["command"].size() > 0, node, "a service without a command");
  return {node["name"].as<std::string>(),
          node["release"].as<std::string>(),
          node["generation"].as<int>(),
          node["standby"].as<bool>(),
          node["command"].as<std::vector<std::string>>(),
          node["clean_up"].as<std::vector<std::string>>(std::vector<std::string>{}),
          node["settings"].as<std::string>(),
          node["made_of"].as<TopicLayouts>(TopicLayouts{})};
}

HostPlan plan_of(const YAML::Node& root) {
  HostPlan plan;
  plan.train_id = root["train_id"].as<std::string>();
  plan.host = root["host"].as<std::string>();
  plan.generation = root["generation"].as<int>();
  plan.previous = root["previous"].as<int>();
  plan.down = root["down"].as<bool>(false);
  plan.train_folder = root["train_folder"].as<std::string>("");
  require(root["services"].IsSequence(), root, "no list of services");
  for (const auto& node : root["services"]) plan.services.push_back(service_of(node));
  return plan;
}

/// Another one after every start of the computer.
std::string boot_id() {
  std::ifstream in("/proc/sys/kernel/random/boot_id");
  std::string id;
  in >> id;
  return id;
}

// After a start of the computer its processes are gone, and others have their numbers.
HostState state_of(const YAML::Node& root) {
  HostState state;
  if (root[kBoot] && root[kBoot].as<std::string>() != boot_id()) return state;
  for (const auto& entry : root) {
    if (entry.first.as<std::string>() == kBoot) continue;
    const auto& one = entry.second;
    state[entry.first.as<std::string>()] = {one["pid"].as<int64_t>(),      one["generation"].as<int>(),
                                            one["restarts"].as<int>(),     one["last_end"].as<std::string>(),
                                            one["beside"].as<bool>(false), one["born"].as<int64_t>(0),
                                            one["refused"].as<bool>(false)};
  }
  return state;
}

}  // namespace

bool PlannedService::runs_beside() const {
  return name == "track_detector" || name == "odometry" || name == "map_matcher" || name == "fusion" ||
         name == "recorder";
}

std::string HostPlan::train() const {
  return train_folder.empty() ? "TRAIN" : core::shell_word(train_folder);
}

const PlannedService* HostPlan::service(const std::string& name) const {
  const auto found = std::find_if(services.begin(), services.end(), [&](const auto& one) { return one.name == name; });
  return found == services.end() ? nullptr : &*found;
}

std::string at_root(const fs::path& root) {
  return root == "/" ? "" : " --root " + core::shell_word(root.string());
}

fs::path HostFolder::generation(int number) const {
  return folder_ / "generations" / std::to_string(number);
}

core::Status HostFolder::may_be_changed() const {
  std::error_code none;
  fs::path there = folder_;
  while (!fs::exists(there, none) && there.has_relative_path()) there = there.parent_path();
  if (there.empty() || access(there.c_str(), W_OK) == 0) return {};
  if (errno == EROFS)
    return core::Error{there.string() +
                       " is mounted read-only; mount -o remount,rw makes it writable again, and dmesg "
                       "says whether the disk is broken"};
  return core::Error{"only root, or who may write to " + there.string() + ", changes what runs here; use sudo"};
}

int HostFolder::newest_generation() const {
  int newest = 0;
  std::error_code none;
  for (const auto& entry : fs::directory_iterator(folder_ / "generations", none)) {
    newest = std::max(newest, std::atoi(entry.path().filename().c_str()));
  }
  return newest;
}

void HostFolder::prune() const {
  const auto now = plan();
  if (!now) return;
  std::set<int> used{now->generation, now->previous};
  for (const auto& running : {now, plan(now->previous)}) {
    if (!running) continue;
    for (const auto& service : running->services) used.insert(service.generation);
  }
  const int newest = newest_generation();
  std::error_code none;
  std::vector<fs::path> old;
  for (const auto& entry : fs::directory_iterator(folder_ / "generations", none)) {
    const int number = std::atoi(entry.path().filename().c_str());
    if (number <= newest - kGenerationsKept && !used.contains(number)) old.push_back(entry.path());
  }
  for (const auto& folder : old) fs::remove_all(folder, none);
}

fs::file_time_type HostFolder::plan_written() const {
  std::error_code none;
  return fs::last_write_time(plan_file(), none);
}

std::optional<HostPlan> HostFolder::plan_in(const fs::path& folder) {
  return load(folder / "plan.yaml", plan_of);
}

core::Status HostFolder::write_to(const fs::path& folder, const HostPlan& plan) {
  YAML::Node root;
  root["train_id"] = plan.train_id;
  root["host"] = plan.host;
  root["generation"] = plan.generation;
  root["previous"] = plan.previous;
  root["down"] = plan.down;
  root["train_folder"] = plan.train_folder;
  root["services"] = YAML::Node(YAML::NodeType::Sequence);
  for (const auto& service : plan.services) {
    YAML::Node node;
    node["name"] = service.name;
    node["release"] = service.release;
    node["generation"] = service.generation;
    node["standby"] = service.standby;
    node["command"] = service.command;
    node["clean_up"] = service.clean_up;
    node["settings"] = service.settings;
    node["made_of"] = service.made_of;
    root["services"].push_back(node);
  }
  // What a plan names is on the disk before the plan, and the plan before anything is done by it: a power cut leaves
  // the old one or the whole new one.
  to_disk(folder);
  auto written = core::write_whole_with_folders(folder / "plan.yaml", YAML::Dump(root) + "\n");
  to_disk(folder);
  return written;
}

bool RunningService::runs() const {
  return pid > 0 && born != 0 && born_of(static_cast<pid_t>(pid)) == born;
}

HostState HostFolder::state() const {
  return load(folder_ / "state.yaml", state_of).value_or(HostState{});
}

core::Status HostFolder::write(const HostState& state) const {
  YAML::Node root(YAML::NodeType::Map);
  root[kBoot] = boot_id();
  for (const auto& [name, service] : state) {
    root[name]["pid"] = service.pid;
    root[name]["generation"] = service.generation;
    root[name]["restarts"] = service.restarts;
    root[name]["last_end"] = service.last_end;
    root[name]["beside"] = service.beside;
    root[name]["born"] = service.born;
    root[name]["refused"] = service.refused;
  }
  return core::write_whole_with_folders(folder_ / "state.yaml", YAML::Dump(root) + "\n");
}

}  // namespace railfix::tool
