// What one topic does, from the samples that come: rate, bandwidth, age, latency, losses and gaps. Knows no DDS. Only
// latency is by the hosts' wall clocks; all else by the monotonic one, so that no clock that is set can hide a silence.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

#include "core/sequence_gaps.hpp"

namespace railfix::monitor {

struct SeenSample {
  int64_t arrived_ns = 0;   // monotonic
  int64_t received_ns = 0;  // the same moment of the wall clock
  int64_t source_ns = 0;    // 0 = not known
  uint64_t sequence = 0;    // counts the writer's samples
  uint64_t writer = 0;
  size_t bytes = 0;
  /// Monotonic, as far as the hosts' clocks agree.
  [[nodiscard]] int64_t sent_ns() const { return arrived_ns - (received_ns - source_ns); }
};

/// Upper bounds in seconds of the latency histogram; everything longer falls beyond the last.
inline constexpr std::array<double, 11> kLatencyBoundsS{0.0005, 0.001, 0.002, 0.005, 0.01, 0.02,
                                                        0.05,   0.1,   0.2,   0.5,   1.0};

struct TopicNumbers {
  uint64_t samples = 0;
  uint64_t bytes = 0;
  uint64_t lost = 0;  // sent, but never came here
  uint64_t gaps = 0;  // pauses of more than three usual ones
  double hz = 0;      // over the last five seconds
  double bytes_per_s = 0;
  double longest_gap_s = 0;  // of the last minute, the present one included
  std::optional<double> age_s;
  /// From sending to coming here, over the last ten seconds; NaN = none came.
  double latency_p50_ms = std::numeric_limits<double>::quiet_NaN();
  double latency_p95_ms = std::numeric_limits<double>::quiet_NaN();
  double latency_p99_ms = std::numeric_limits<double>::quiet_NaN();
};

class TopicStatistics {
 public:
  /// exclusive: one of its writers is heard at a time.
  explicit TopicStatistics(bool exclusive = false) : exclusive_(exclusive) {}
  void add(const SeenSample& sample);
  [[nodiscard]] TopicNumbers numbers(int64_t now_ns) const;  // monotonic
  /// How many latencies lay at or below each bound and above the one before; the last one counts those beyond.
  [[nodiscard]] const std::array<uint64_t, kLatencyBoundsS.size() + 1>& latency_counts() const {
    return latency_counts_;
  }
  [[nodiscard]] double latency_sum_s() const { return latency_sum_s_; }
  /// Pause between samples as it usually is; 0 = not known yet.
  [[nodiscard]] double usual_gap_s() const { return samples_ < kSamplesToKnow ? 0 : usual_gap_s_; }

 private:
  static constexpr uint64_t kSamplesToKnow = 10;
  struct Slice {
    int64_t number = -1;  // since the clock's zero
    uint64_t samples = 0;
    uint64_t bytes = 0;
    int64_t longest_gap_ns = 0;
  };
  struct Latency {
    int64_t arrived_ns = 0;
    float ms = 0;
  };
  void note_latency(const SeenSample& sample);
  void note_gap(int64_t gap_ns);
  Slice& slice(int64_t at_ns);

  uint64_t samples_ = 0;
  uint64_t bytes_ = 0;
  uint64_t lost_ = 0;
  uint64_t gaps_ = 0;
  int64_t first_ns_ = 0;
  int64_t last_ns_ = 0;
  double usual_gap_s_ = 0;
  std::array<Slice, 240> slices_;   // a minute, four a second
  std::vector<Latency> latencies_;  // a ring
  size_t next_latency_ = 0;
  std::array<uint64_t, kLatencyBoundsS.size() + 1> latency_counts_{};
  double latency_sum_s_ = 0;
  bool exclusive_;
  core::SequenceGaps sequences_;
};

}  // namespace railfix::monitor
