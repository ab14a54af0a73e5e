// /metrics: the train for Prometheus (text format 0.0.4). Knows no DDS and no clock.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "monitor/problems.hpp"

namespace railfix::monitor {

struct MetricTopic {
  std::string name;
  int writers = 0;
  TopicNumbers numbers;
  uint64_t dropped = 0;   // waited too long in front of the monitor itself
  uint64_t rejected = 0;  // the middleware had no room for them
  uint64_t deadlines_missed = 0;
  std::array<uint64_t, kLatencyBoundsS.size() + 1> latency_counts{};
  double latency_sum_s = 0;
};

struct MetricsInput {
  std::string train;
  std::string version;
  std::string host;
  const TrainSeen* seen = nullptr;
  std::vector<MetricTopic> topics;
  const std::vector<Problem>* problems = nullptr;
  uint64_t reports = 0;  // position reports since the monitor began
  size_t viewers = 0;
  uint64_t slow_viewers = 0;  // disconnected
};

std::string metrics_text(const MetricsInput& input);

}  // namespace railfix::monitor
