#include "service/health.hpp"

#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <fstream>

#include "core/cut_text.hpp"
#include "core/quantile.hpp"
#include "core/time.hpp"
#include "service/release.hpp"

namespace railfix::service {
namespace {

constexpr int64_t kMeasurePeriodNs = core::kNsPerSecond;
constexpr size_t kMostLatencies = 4096;
constexpr size_t kReasonBytes = 255;

int64_t used_cpu_ns() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  const auto ns = [](const timeval& time) { return time.tv_sec * core::kNsPerSecond + time.tv_usec * 1000; };
  return ns(usage.ru_utime) + ns(usage.ru_stime);
}

double resident_mb() {
  std::ifstream statm("/proc/self/statm");
  double total_pages = 0;
  double resident_pages = 0;
  statm >> total_pages >> resident_pages;
  return resident_pages * static_cast<double>(sysconf(_SC_PAGESIZE)) / 1e6;
}

}  // namespace

PublishedHealth::PublishedHealth(messaging::Participant& participant, const std::string& service,
                                 const CommonConfig& common, bool beside, spdlog::logger& log)
    : participant_(participant),
      log_(log),
      writer_(participant, messaging::topics::service_status),
      file_(beside ? health_path_beside(common, service) : health_path(common, service)),
      measured_ns_(core::monotonic_ns()),
      cpu_ns_(used_cpu_ns()) {
  status_.service(service);
  status_.host(common.host);
  status_.version(release());
  status_.pid(static_cast<uint32_t>(getpid()));
  status_.state(msg::STATE_STARTING);
  published_ = status_;
}

void PublishedHealth::input() {
  status_.frames_in(status_.frames_in() + 1);
  const int64_t now_ns = core::monotonic_ns();
  if (now_ns - traffic_.last_input_ns > kFlowGapNs) traffic_.input_since_ns = now_ns;
  traffic_.last_input_ns = now_ns;
}

void PublishedHealth::output(int64_t grabbed_ns) {
  traffic_.last_output_ns = core::monotonic_ns();
  status_.frames_out(status_.frames_out() + 1);
  if (grabbed_ns > 0 && latencies_ms_.size() < kMostLatencies) {
    latencies_ms_.push_back(static_cast<double>(core::wall_ns() - grabbed_ns) / 1e6);
  }
}

// Services say how they are with every sample.
void PublishedHealth::change(uint8_t state, const std::string& reason) {
  const std::string cut = core::cut_text(reason, kReasonBytes);
  if (status_.state() == state && cut == status_.reason().c_str()) return;
  status_.state(state);
  status_.reason(cut);
  publish_news();
}

void PublishedHealth::stands_by(const std::string& sentence) {
  if (sentence == stands_by_) return;
  stands_by_ = sentence;
  publish_news();
}

void PublishedHealth::trouble(Trouble kind, const std::string& sentence) {
  auto& known = troubles_[static_cast<size_t>(kind)];
  if (sentence == known) return;
  known = sentence;
  publish_news();
}

void PublishedHealth::publish_news() {
  const auto now = said();
  if (now.state() != published_.state() || now.reason() != published_.reason()) publish();
}

bool PublishedHealth::discovers() {
  const bool goes_on = participant_.discovery_goes_on(core::monotonic_ns());
  if (!goes_on && !stuck_)
    log_.critical("the discovery has been at one message for 5 s: the middleware waits for itself");
  stuck_ = !goes_on;
  return goes_on;
}

void PublishedHealth::beat() {
  if (discovers()) file_.beat();
}

void PublishedHealth::publish() {
  measure();
  const auto connections = participant_.connections();
  status_.endpoints(connections.endpoints);
  status_.matches(connections.matches);
  status_.stamp_ns(core::wall_ns());
  published_ = said();
  writer_.write(published_);
  traffic_.stands_by = !stands_by_.empty();
  if (discovers()) file_.write(published_, traffic_, serves_);
  log_news();
}

void PublishedHealth::log_news() {
  const auto line = state_log_.follow(published_.state(), published_.reason().c_str(), core::monotonic_ns());
  if (line) log_.log(line->trouble ? spdlog::level::warn : spdlog::level::info, "{}", line->text);
}

msg::ServiceStatus PublishedHealth::said() const {
  msg::ServiceStatus said = status_;
  if (!stands_by_.empty() && (said.state() == msg::STATE_ACTIVE || said.state() == msg::STATE_DEGRADED)) {
    said.state(msg::STATE_READY);
    said.reason(stands_by_);
  }
  for (const auto& trouble : troubles_) {
    if (trouble.empty()) continue;
    if (said.state() == msg::STATE_READY || said.state() == msg::STATE_ACTIVE) said.state(msg::STATE_DEGRADED);
    const std::string reason = said.reason().c_str();
    said.reason(core::cut_text(trouble + (reason.empty() ? "" : " ") + reason, kReasonBytes));
  }
  return said;
}

void PublishedHealth::measure() {
  const int64_t now_ns = core::monotonic_ns();
  if (now_ns - measured_ns_ < kMeasurePeriodNs) return;
  const int64_t cpu_ns = used_cpu_ns();
  status_.cpu_percent(100.0 * static_cast<double>(cpu_ns - cpu_ns_) / static_cast<double>(now_ns - measured_ns_));
  status_.rss_mb(resident_mb());
  if (latencies_ms_.empty()) latencies_ms_.push_back(0);  // nothing went out
  std::ranges::sort(latencies_ms_);
  status_.latency_p50_ms(core::quantile(latencies_ms_, 0.50));
  status_.latency_p99_ms(core::quantile(latencies_ms_, 0.99));
  latencies_ms_.clear();
  measured_ns_ = now_ns;
  cpu_ns_ = cpu_ns;
}

}  // namespace railfix::service
