// Private to this folder: counts, measures and publishes service_status.
#pragma once

#include <array>
#include <vector>

#include "service/health_file.hpp"
#include "service/service.hpp"
#include "service/state_log.hpp"

namespace railfix::service {

/// What the loop itself finds wrong, beside what the service says.
enum class Trouble { clock, writers, certificates };

class PublishedHealth final : public Health {
 public:
  PublishedHealth(messaging::Participant& participant, const std::string& service, const CommonConfig& common,
                  bool beside, spdlog::logger& log);

  void ready() override { change(msg::STATE_READY, ""); }
  void active() override { change(msg::STATE_ACTIVE, ""); }
  void degraded(const std::string& reason) override { change(msg::STATE_DEGRADED, reason); }
  void failed(const std::string& reason) override { change(msg::STATE_FAILED, reason); }
  void input() override;
  void output(int64_t grabbed_ns) override;
  void dropped(uint64_t count) override { status_.dropped(status_.dropped() + count); }
  void flows(Flow flow) override { traffic_.flow = flow; }
  void serves(const std::string& address) override { serves_ = address; }

  /// Empty = it is in charge.
  void stands_by(const std::string& sentence);
  /// Empty = none; a service that is ready or active is degraded by it.
  void trouble(Trouble kind, const std::string& sentence);
  void stopped() { change(msg::STATE_STOPPED, ""); }
  /// The loop turns: told to this host, many times between two publish(); not while the discovery is stuck, so that who
  /// watches this process starts it anew.
  void beat();
  /// Publishes; measures processor and latency anew when the measuring period has passed.
  void publish();

 private:
  void change(uint8_t state, const std::string& reason);
  [[nodiscard]] bool discovers();
  void measure();
  /// When what it says is not what was published last.
  void publish_news();
  [[nodiscard]] msg::ServiceStatus said() const;
  void log_news();
  messaging::Participant& participant_;
  spdlog::logger& log_;
  StateLog state_log_;
  messaging::Writer<msg::ServiceStatus> writer_;
  HealthFile file_;
  msg::ServiceStatus status_;  // as the service says
  msg::ServiceStatus published_;
  std::string stands_by_;
  Traffic traffic_;
  std::string serves_;
  bool stuck_ = false;
  std::array<std::string, 3> troubles_;
  std::vector<double> latencies_ms_;  // since the last measurement
  int64_t measured_ns_ = 0;
  int64_t cpu_ns_ = 0;
};

}  // namespace railfix::service
