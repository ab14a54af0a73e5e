// What one topic does, from the samples that come: rate, bandwidth, age, latency, losses and gaps. Knows no DDS. All is
// by the monotonic clock, so that no clock that is set can hide a silence, but for latency and BeforeListening.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <map>
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
  uint64_t gaps = 0;  // pauses of a writer of more than three usual ones
  double hz = 0;      // over the last five seconds
  double bytes_per_s = 0;
  double longest_gap_s = 0;  // of the last minute, the present one included
  std::optional<double> age_s;
  /// From sending to coming here, over the last ten seconds; NaN = none came.
  double latency_p50_ms = std::numeric_limits<double>::quiet_NaN();
  double latency_p95_ms = std::numeric_limits<double>::quiet_NaN();
  double latency_p99_ms = std::numeric_limits<double>::quiet_NaN();
};

/// Of a standing value the last samples from before one listened come, too: they say nothing about the way here. The
/// clocks of two hosts may differ, so their stamps are asked only as long as such a sample can be on its way.
class BeforeListening {
 public:
  BeforeListening() = default;
  BeforeListening(bool standing, int64_t since_ns) : standing_(standing), since_ns_(since_ns) {}
  bool was_sent(const SeenSample& sample);

 private:
  bool standing_ = false;
  int64_t since_ns_ = 0;  // monotonic
  struct Met {
    int64_t first_ns = 0;
    int64_t last_ns = 0;
  };
  std::map<uint64_t, Met> met_;  // each writer's samples here
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
  /// Pause between samples of a writer as it usually is, the shortest of all that have come in the minute before the
  /// newest sample; 0 = not known yet.
  [[nodiscard]] double usual_gap_s() const;

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
  /// Of one writer; of all where one is heard at a time.
  struct Pace {
    uint64_t samples = 0;
    int64_t last_ns = 0;
    double usual_gap_s = 0;
  };
  void note_latency(const SeenSample& sample);
  void note_pace(const SeenSample& sample);
  void forget_gone();
  Slice& slice(int64_t at_ns);

  uint64_t samples_ = 0;
  uint64_t bytes_ = 0;
  uint64_t lost_ = 0;
  uint64_t gaps_ = 0;
  int64_t first_ns_ = 0;
  int64_t last_ns_ = 0;
  std::map<uint64_t, Pace> paces_;
  std::array<Slice, 240> slices_;   // a minute, four a second
  std::vector<Latency> latencies_;  // a ring
  size_t next_latency_ = 0;
  std::array<uint64_t, kLatencyBoundsS.size() + 1> latency_counts_{};
  double latency_sum_s_ = 0;
  bool exclusive_;
  core::SequenceGaps sequences_;
};

}  // namespace railfix::monitor
