#include "monitor/metrics.hpp"

#include <prometheus/text_serializer.h>

#include <algorithm>
#include <limits>
#include <sstream>

#include "core/time.hpp"
#include "messaging/message_words.hpp"

namespace railfix::monitor {
namespace {

using prometheus::ClientMetric;
using prometheus::MetricFamily;
using prometheus::MetricType;
using Labels = std::vector<ClientMetric::Label>;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

/// Families in the order in which they are first named.
class Families {
 public:
  void gauge(const std::string& name, const char* help, double value, Labels labels = {}) {
    ClientMetric metric;
    metric.label = std::move(labels);
    metric.gauge.value = value;
    family(name, help, MetricType::Gauge).metric.push_back(std::move(metric));
  }
  void counter(const std::string& name, const char* help, uint64_t value, Labels labels = {}) {
    ClientMetric metric;
    metric.label = std::move(labels);
    metric.counter.value = static_cast<double>(value);
    family(name, help, MetricType::Counter).metric.push_back(std::move(metric));
  }
  MetricFamily& family(const std::string& name, const char* help, MetricType type) {
    for (auto& known : families_) {
      if (known.name == name) return known;
    }
    families_.push_back({name, help, type, {}});
    return families_.back();
  }
  [[nodiscard]] const std::vector<MetricFamily>& all() const { return families_; }

 private:
  std::vector<MetricFamily> families_;
};

void add_latency(Families& families, const MetricTopic& topic) {
  ClientMetric metric;
  metric.label = {{"topic", topic.name}};
  uint64_t count = 0;
  for (size_t i = 0; i < topic.latency_counts.size(); ++i) {
    count += topic.latency_counts[i];
    const double bound = i < kLatencyBoundsS.size() ? kLatencyBoundsS[i] : std::numeric_limits<double>::infinity();
    metric.histogram.bucket.push_back({count, bound});
  }
  metric.histogram.sample_count = count;
  metric.histogram.sample_sum = topic.latency_sum_s;
  families
      .family("railfix_topic_latency_seconds", "From sending a sample to its coming to the monitor.",
              MetricType::Histogram)
      .metric.push_back(std::move(metric));
}

void add_topics(Families& families, const MetricsInput& input) {
  for (const auto& topic : input.topics) {
    const Labels labels{{"topic", topic.name}};
    const auto& numbers = topic.numbers;
    families.gauge("railfix_topic_writers", "Writers of the topic that are there now.", topic.writers, labels);
    families.counter("railfix_topic_samples_total", "Samples that came since the monitor listens to the topic.",
                     numbers.samples, labels);
    families.counter("railfix_topic_bytes_total", "Bytes of these samples, as CDR.", numbers.bytes, labels);
    families.counter("railfix_topic_lost_total", "Samples that were sent and never came to the monitor.", numbers.lost,
                     labels);
    families.counter("railfix_topic_dropped_total", "Samples that came and waited too long for the monitor.",
                     topic.dropped, labels);
    families.counter("railfix_topic_rejected_total", "Samples that the monitor's middleware had no room for.",
                     topic.rejected, labels);
    families.counter("railfix_topic_deadlines_missed_total",
                     "Times that the topic's deadline passed without a sample; 0 for topics without one.",
                     topic.deadlines_missed, labels);
    families.counter("railfix_topic_gaps_total", "Pauses of more than three usual ones.", numbers.gaps, labels);
    families.gauge("railfix_topic_rate_hertz", "Samples a second over the last five seconds.", numbers.hz, labels);
    families.gauge("railfix_topic_age_seconds", "Since the last sample; NaN = none came yet.",
                   numbers.age_s.value_or(kNaN), labels);
    add_latency(families, topic);
  }
}

void add_expected(Families& families, const TrainSeen& seen) {
  if (seen.played) return;  // a player stands in for all services
  for (const auto& [service, host] : seen.expected) {
    Labels labels{{"service", service}};
    if (!host.empty()) labels.push_back({"host", host});
    families.gauge("railfix_service_expected", "1: it must be there, on this host if one is named.", 1, labels);
  }
}

// What a service that is silent said last of itself is not so any more.
void add_work(Families& families, const messaging::ServiceSeen& service, const Labels& labels) {
  const msg::ServiceStatus& status = service.status;
  const bool runs = service.runs();
  families.gauge("railfix_service_cpu_ratio", "Processor cores in use.", runs ? status.cpu_percent() / 100 : kNaN,
                 labels);
  families.gauge("railfix_service_resident_bytes", "Memory in use.", runs ? status.rss_mb() * 1e6 : kNaN, labels);
  for (const auto& [percentile, ms] :
       {std::pair{"50", status.latency_p50_ms()}, std::pair{"99", status.latency_p99_ms()}}) {
    Labels with_percentile = labels;
    with_percentile.push_back({"percentile", percentile});
    families.gauge("railfix_service_latency_seconds",
                   "From the grab of the input to the output, over the last second; NaN = none was measured.",
                   runs && ms > 0 ? ms / 1e3 : kNaN, with_percentile);
  }
}

void add_services(Families& families, const TrainSeen& seen) {
  add_expected(families, seen);
  for (const auto& [key, service] : seen.services->services()) {
    const Labels labels{{"service", service.name()}, {"host", key.first}};
    const auto& status = service.status;
    if (!service.stopped() || seen.needs(key)) {
      families.gauge("railfix_service_up",
                     "1: it shows signs of life and has neither failed nor been stopped. Not of one that was stopped "
                     "and is not needed.",
                     service.runs() && status.state() != msg::STATE_FAILED ? 1 : 0, labels);
    }
    for (uint8_t state = msg::STATE_STARTING; state <= msg::STATE_STOPPED; ++state) {
      Labels with_state = labels;
      with_state.push_back({"state", messaging::name_of_state(state)});
      const bool known = service.alive || service.stopped();
      families.gauge("railfix_service_state",
                     "1 for the state that the service is in, 0 for all others, and for all when it is silent.",
                     known && status.state() == state ? 1 : 0, with_state);
    }
    families.gauge("railfix_service_heartbeat_age_seconds", "Since the last status.",
                   core::seconds(seen.now_ns - service.received_ns), labels);
    families.counter("railfix_service_inputs_total", "Input samples used.", status.frames_in(), labels);
    families.counter("railfix_service_outputs_total", "Output samples sent.", status.frames_out(), labels);
    families.counter("railfix_service_dropped_total", "Inputs that were lost or came too late.", status.dropped(),
                     labels);
    add_work(families, service, labels);
  }
}

// A train without a map lacks no track that an alert could ask for.
double track_known(const TrainSeen& seen, const msg::TrainState& state) {
  if (!seen.on_map()) return kNaN;
  return state.track_known() != 0 ? 1 : 0;
}

void add_position(Families& families, const MetricsInput& input) {
  families.counter("railfix_position_reports_total", "Position reports since the monitor began.", input.reports);
  const auto& seen = *input.seen;
  if (seen.state || seen.awaited_s) {
    families.gauge("railfix_position_age_seconds",
                   "Since the last train_state; before the first since fusion is there, or since the data began.",
                   seen.state ? seen.state_age_s : *seen.awaited_s);
  }
  if (!seen.state) return;
  const auto* now = seen.position_now();
  families.gauge("railfix_position_behind_seconds",
                 "How old the last train_state was already when it came, by its stamp; NaN for played data, and when "
                 "the last one is old.",
                 now != nullptr ? seen.state_behind_s.value_or(kNaN) : kNaN);
  const auto gauge = [&](const std::string& name, const std::string& help, double value) {
    families.gauge(name, (help + "; NaN = not known, or the last train_state is old.").c_str(), now ? value : kNaN);
  };
  const auto& state = *seen.state;
  gauge("railfix_position_over_meters", "The train may be this far behind its estimate", state.over_m());
  gauge("railfix_position_under_meters", "The train may be this far before its estimate", state.under_m());
  gauge("railfix_position_since_reference_meters", "Travelled since the last landmark or fix",
        state.since_reference_m());
  gauge("railfix_position_track_known",
        "1: it is known which track the train is on; NaN where the monitor has no map and fusion names no place",
        track_known(seen, state));
  gauge("railfix_position_track_probability", "That it is this track and no other", state.track_probability());
  gauge("railfix_position_integrity", "0 ok, 1 degraded, 2 unusable", state.integrity());
  gauge("railfix_train_speed_meters_per_second", "Signed, along the cab's forward axis", state.speed_mps());
}

void add_recorder(Families& families, const msg::RecorderStatus& recorder) {
  families.gauge("railfix_recorder_state", "0 stopped, 1 recording, 2 paused, 3 waiting for an event.",
                 recorder.state());
  families.gauge("railfix_recorder_file_bytes", "Of the open file on the disk.", static_cast<double>(recorder.bytes()));
  families.gauge("railfix_recorder_bytes_per_second", "Written to the disk.", recorder.bytes_per_s());
  families.gauge("railfix_recorder_queue_bytes", "Waiting for the disk.", recorder.queue_mb() * 1e6);
  families.gauge("railfix_recorder_disk_free_bytes", "On the disk of the recordings.", recorder.disk_free_mb() * 1e6);
  uint64_t transport = 0;
  uint64_t encoder = 0;
  uint64_t queue = 0;
  uint64_t disk = 0;
  for (const auto& topic : recorder.lost()) {
    transport += topic.transport();
    encoder += topic.encoder();
    queue += topic.queue();
    disk += topic.disk();
  }
  for (const auto& [cause, lost] : {std::pair{"transport", transport}, std::pair{"encoder", encoder},
                                    std::pair{"queue", queue}, std::pair{"disk", disk}}) {
    families.counter("railfix_recorder_lost_samples_total", "Samples that the open file lacks, by cause.", lost,
                     {{"cause", cause}});
  }
}

}  // namespace

std::string metrics_text(const MetricsInput& input) {
  Families families;
  families.gauge("railfix_info", "What runs here.", 1,
                 {{"train", input.train}, {"version", input.version}, {"host", input.host}});
  add_services(families, *input.seen);
  add_position(families, input);
  if (input.seen->recorder) add_recorder(families, *input.seen->recorder);
  add_topics(families, input);
  for (const auto& [name, level] : {std::pair{"error", Level::error}, std::pair{"warning", Level::warning}}) {
    const auto count = std::ranges::count_if(
        *input.problems, [level = level](const Problem& problem) { return problem.level == level; });
    families.gauge("railfix_problems", "Problems that the monitor sees now.", static_cast<double>(count),
                   {{"level", name}});
  }
  if (input.seen->shared_memory_free_mb >= 0) {
    families.gauge("railfix_shm_free_bytes", "Left in /dev/shm, which pictures travel through.",
                   input.seen->shared_memory_free_mb * 1e6);
  }
  for (const auto& one : input.seen->certificates) {
    families.gauge("railfix_certificate_days_left", "Until the certificate of a service runs out.",
                   static_cast<double>(one.days_left), {{"service", one.service}, {"host", one.host}});
  }
  families.gauge("railfix_monitor_viewers", "Connected to the monitor.", static_cast<double>(input.viewers));
  families.counter("railfix_monitor_slow_viewers_total", "Disconnected because they were too slow.",
                   input.slow_viewers);
  std::ostringstream text;
  prometheus::TextSerializer().Serialize(text, families.all());
  return std::move(text).str();
}

}  // namespace railfix::monitor
