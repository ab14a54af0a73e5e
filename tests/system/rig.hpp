// A whole train of real processes on two hosts (network namespaces with a cable), as an operator would run it:
// manifest, keys, `railfix train supervise`. It rides along a drawn line at real pace. Needs root.
#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "support/program.hpp"
#include "support/two_hosts.hpp"
#include "train/plan.hpp"

namespace railfix::system_test {

using test::TwoHosts;

struct RigOptions {
  std::filesystem::path ride;  // dataset with truth
  bool break_pictures = true;  // a copy is played, whose pictures may be replaced
  bool security = true;
  bool standby = true;
  int64_t picture_every = 1;  // of the recording
};

/// What this process mounts from now on is seen by itself and its children only; so is a /dev/shm of its own.
/// False without the right to do so.
bool enter_own_mounts(int64_t shared_memory_mb);

class Rig {
 public:
  explicit Rig(const RigOptions& options);
  ~Rig();
  Rig(const Rig&) = delete;
  Rig& operator=(const Rig&) = delete;

  /// Starts the ride anew: manifest, keys, both hosts. Services come up by themselves.
  void depart();
  void stop();
  /// Once it rides: services that are started from now on are not told where the ride began.
  void forget_start() const;
  /// Manifest, keys and plans as they would be, without starting anything.
  void prepare();
  /// All processes of a host at once, and its cable.
  void cut_power(const std::string& host);
  void kill_supervisor(const std::string& host);
  void power_on(const std::string& host);
  [[nodiscard]] double ridden_s() const;

  /// "fusion@cab", in the order of the manifest, standbys included.
  [[nodiscard]] std::vector<std::string> services() const;
  /// 0 while it does not run.
  [[nodiscard]] pid_t pid(const std::string& service_at_host) const;
  void send(const std::string& service_at_host, int signal) const;
  /// Another process than `before` runs, and nothing beside it any more.
  [[nodiscard]] bool replaced(const std::string& service_at_host, pid_t before) const;
  /// Its process is replaced by another one of the same build, as an upgrade would do.
  void swap(const std::string& service_at_host) const;
  /// More arguments for one service: it is started anew with them, as an upgrade would do; none = as it was.
  void set_arguments(const std::string& service_at_host, const std::vector<std::string>& arguments) const;

  /// Copies recordings and logs as they are now to where they outlive the rig, and gives that folder.
  [[nodiscard]] std::filesystem::path keep_evidence() const;

  TwoHosts& hosts() { return *hosts_; }
  [[nodiscard]] const RigOptions& options() const { return options_; }
  [[nodiscard]] const std::string& train_id() const { return train_id_; }
  [[nodiscard]] std::filesystem::path root(const std::string& host) const { return folder_ / host; }
  [[nodiscard]] std::filesystem::path folder() const { return folder_; }
  /// The keys of this train's tools; empty without security.
  [[nodiscard]] std::filesystem::path keys() const;
  [[nodiscard]] std::filesystem::path pictures() const { return folder_ / "ride/mav0/cam0/data"; }
  /// Seconds that this host's clock is ahead.
  void step_clock(const std::string& host, double seconds) const;
  static TwoHosts::Host host_of(const std::string& name) { return name == "cab" ? TwoHosts::cab : TwoHosts::coach; }

  static constexpr int64_t kDomain = 90;  // in networks of its own
  static constexpr int kMonitorPort = 8480;
  static constexpr const char* kBroker = "10.42.1.12:1883";

 private:
  [[nodiscard]] std::filesystem::path clock_file(const std::string& host) const { return folder_ / (host + ".clock"); }
  [[nodiscard]] std::filesystem::path played() const {
    return options_.break_pictures ? folder_ / "ride" : options_.ride;
  }
  [[nodiscard]] tool::RunningService running(const std::string& service_at_host) const;
  void copy_ride();
  void kill_services(const std::string& host) const;
  void write_manifest();
  void start_broker();
  RigOptions options_;
  std::string train_id_;
  std::filesystem::path folder_;
  std::unique_ptr<TwoHosts> hosts_;
  int64_t began_ns_ = 0;  // wall clock at which the ride's first picture is taken
  std::unique_ptr<test::Program> broker_;
  std::map<std::string, std::unique_ptr<test::Program>> supervisors_;
};

}  // namespace railfix::system_test
