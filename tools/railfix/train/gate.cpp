#include "train/gate.hpp"

#include <algorithm>

namespace railfix::tool {
namespace {

constexpr int64_t kSayNs = 5 * core::kNsPerSecond;

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

/// Somebody has typed `down`.
class DownWatch {
 public:
  explicit DownWatch(const HostFolder& folder) : folder_(folder) {}
  bool is_down() {
    const auto written = folder_.plan_written();
    if (written == looked_at_) return false;
    looked_at_ = written;
    const auto plan = folder_.plan();
    return plan && plan->down;
  }

 private:
  const HostFolder& folder_;
  std::filesystem::file_time_type looked_at_{};
};

}  // namespace

Waited wait_healthy(const HostFolder& folder, const HostPlan& plan, const std::vector<std::string>& services,
                    const HealthGate& gate, const Say& say, bool must_send) {
  std::vector<Gate> gates;
  for (const auto& service : services) gates.emplace_back(folder, plan, service, gate.healthy_s, must_send);
  std::vector<const Gate*> closed;
  DownWatch down(folder);
  bool refused = false;
  bool is_down = false;
  bool interrupted = false;
  int64_t say_ns = core::monotonic_ns() + kSayNs;
  const bool ended = wait_until(gate.patience_s, [&] {
    closed.clear();
    for (auto& one : gates) {
      if (!one.passed()) closed.push_back(&one);
    }
    refused = std::ranges::any_of(closed, &Gate::refuses);
    is_down = down.is_down();
    interrupted = gate.is_interrupted();
    if (core::monotonic_ns() > say_ns && !closed.empty() && !refused) {
      say("waiting: " + problems_of(closed));
      say_ns += kSayNs;
    }
    return closed.empty() || refused || is_down || interrupted;
  });
  if (is_down) return {core::Error{kChangedMeanwhile}, true};
  if (interrupted) return {core::Error{"interrupted"}, true};
  if (ended && !refused) return {};
  if (refused) std::erase_if(closed, [](const Gate* one) { return !one->refuses(); });
  return {core::Error{problems_of(closed)}, false};
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

}  // namespace railfix::tool
