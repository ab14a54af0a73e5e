// What one host runs: the commands of its services, as files that the supervisor reads and `railfix train` writes.
//
//   ROOT/var/lib/railfix-train/generations/N/  configuration, map, keys and compose file of generation N, never changed
//   again ROOT/var/lib/railfix-train/plan.yaml       which service runs with which generation; replaced in one step
//   ROOT/var/lib/railfix-train/state.yaml      what the supervisor says: processes and how often they were restarted
//   ROOT/var/lib/railfix-train/log/            what the services say
#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/result.hpp"

namespace railfix::tool {

/// Of each IDL file that a program was made of, a number that tells its layout.
using TopicLayouts = std::map<std::string, std::string>;

struct PlannedService {
  std::string name;
  std::string release;
  int generation = 0;
  bool standby = false;
  std::vector<std::string> command;
  std::vector<std::string> clean_up;  // run before each start and after a kill; empty = nothing to do
  std::string settings;               // everything that the service reads; another text means that it must be restarted
  TopicLayouts made_of = {};          // empty = it did not say

  /// Started anew it runs beside the one before until it has found everybody. Not for those that own what only one can
  /// have: a camera, a serial line, a port, a store.
  [[nodiscard]] bool runs_beside() const;
  /// Whose processes the supervisor sees only through an engine.
  [[nodiscard]] bool in_container() const { return !clean_up.empty(); }
  bool operator==(const PlannedService&) const = default;
};

struct HostPlan {
  std::string train_id;
  std::string host;
  int generation = 0;  // the newest one whose roll-out succeeded or is under way
  int previous = 0;    // the one before of this train, 0 = none
  bool down = false;   // nothing is to run until the train is brought up again, after a restart of the computer neither
  std::vector<PlannedService> services;
  std::string train_folder = {};  // of the train.yaml that was last brought here, absolute; empty = not noted

  /// As an operator types it.
  [[nodiscard]] std::string train() const;
  [[nodiscard]] const PlannedService* service(const std::string& name) const;
};

struct RunningService {
  int64_t pid = 0;  // 0 = waits to be started again
  int generation = 0;
  int restarts = 0;  // since it was started with this generation
  std::string last_end;
  bool beside = false;   // the one before still runs, and sends
  int64_t born = 0;      // born_of(pid)
  bool refused = false;  // the process before has ended with exit code 2: what it is to work with is wrong

  /// It, and no later process of the same number.
  [[nodiscard]] bool runs() const;
};
/// By name; one that is being replaced stands there with kBefore behind its name.
using HostState = std::map<std::string, RunningService>;
inline constexpr const char* kBefore = " before";

/// As an operator types it behind a command; empty for "/".
std::string at_root(const std::filesystem::path& root);

/// The folder of all this. Services that run in containers do not see it, but for their own files of their generation.
class HostFolder {
 public:
  explicit HostFolder(const std::filesystem::path& root)
      : home_(root / "var/lib/railfix"), folder_(root / "var/lib/railfix-train") {}
  /// Where services run: recordings, reports that wait for the ground.
  [[nodiscard]] const std::filesystem::path& home() const { return home_; }
  [[nodiscard]] std::filesystem::path generation(int number) const;
  [[nodiscard]] std::filesystem::path log(const std::string& service) const {
    return folder_ / "log" / (service + ".log");
  }
  [[nodiscard]] std::filesystem::path plan_file() const { return folder_ / "plan.yaml"; }
  [[nodiscard]] std::filesystem::path lock() const { return folder_ / "supervisor.lock"; }
  /// Of the command that changes what runs here, of `down`, and of who reads the plan to write it anew.
  [[nodiscard]] std::filesystem::path command_lock() const { return folder_ / "command.lock"; }
  [[nodiscard]] std::filesystem::path down_lock() const { return folder_ / "down.lock"; }
  [[nodiscard]] std::filesystem::path plan_lock() const { return folder_ / "plan.lock"; }
  [[nodiscard]] int newest_generation() const;
  /// Error: this user may not change what runs here.
  [[nodiscard]] core::Status may_be_changed() const;

  /// Nothing when no train was brought up here. Of all these and state(): throws BadInput, a sentence with the file and
  /// the way out, when the file is damaged.
  [[nodiscard]] std::optional<HostPlan> plan() const { return plan_in(folder_); }
  /// As it was installed, with all services of this generation.
  [[nodiscard]] std::optional<HostPlan> plan(int number) const { return plan_in(generation(number)); }
  core::Status write(const HostPlan& plan) const { return write_to(folder_, plan); }
  core::Status write_generation(const HostPlan& plan) const { return write_to(generation(plan.generation), plan); }
  [[nodiscard]] std::filesystem::file_time_type plan_written() const;
  [[nodiscard]] HostState state() const;
  core::Status write(const HostState& state) const;
  /// Removes old generations: all but the newest five and those that the plan runs or can go back to.
  void prune() const;

 private:
  [[nodiscard]] static std::optional<HostPlan> plan_in(const std::filesystem::path& folder);
  static core::Status write_to(const std::filesystem::path& folder, const HostPlan& plan);
  std::filesystem::path home_;
  std::filesystem::path folder_;
};

}  // namespace railfix::tool
