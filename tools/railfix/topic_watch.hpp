// What there is to know about a topic while listening to it: rate, gaps, losses. And which name was probably meant.
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "core/sequence_gaps.hpp"
#include "messaging/messaging.hpp"

namespace railfix::tool {

/// Statistics of one topic are told since when it is listened to (host's clock): what was sent before and still stands
/// says nothing of rate, losses and the way here.
class TopicStatistics {
 public:
  explicit TopicStatistics(int64_t since_ns = 0) : since_ns_(since_ns) {}
  void add(const messaging::TopicInfo& topic, const messaging::SampleInfo& info);

  [[nodiscard]] uint64_t samples() const { return samples_ + standing_; }
  /// From the first to the last sample; 0 with less than two.
  [[nodiscard]] double rate_hz() const;
  /// The same where they fill half of the time that was listened; else samples over that time, since two in a
  /// row say nothing of a rate.
  [[nodiscard]] double rate_hz(double listened_s) const;
  [[nodiscard]] double shortest_gap_ms() const;
  [[nodiscard]] double longest_gap_ms() const;
  /// Samples that a writer sent and that never came.
  [[nodiscard]] uint64_t lost() const { return lost_; }
  /// From sending to receiving, of the last sample (meaningful when both hosts' clocks agree).
  [[nodiscard]] double latency_ms() const { return latency_ms_; }

 private:
  int64_t since_ns_;
  uint64_t standing_ = 0;
  uint64_t samples_ = 0;
  uint64_t lost_ = 0;
  int64_t first_ns_ = 0;
  int64_t last_ns_ = 0;
  int64_t shortest_ns_ = 0;
  int64_t longest_ns_ = 0;
  double latency_ms_ = 0;
  core::SequenceGaps sequences_;
};

/// What `railfix topics hz`, `bw` and `delay` say of one topic.
class RateStatistics {
 public:
  explicit RateStatistics(int64_t since_ns = 0) : all_(since_ns) {}
  void add(const messaging::TopicInfo& topic, const void*, const messaging::SampleInfo& info) { all_.add(topic, info); }
  [[nodiscard]] uint64_t samples() const { return all_.samples(); }
  [[nodiscard]] std::string line() const;
  [[nodiscard]] nlohmann::ordered_json json() const;

 private:
  TopicStatistics all_;
};

class BandwidthStatistics {
 public:
  explicit BandwidthStatistics(int64_t since_ns = 0) : all_(since_ns) {}
  void add(const messaging::TopicInfo& topic, const void* sample, const messaging::SampleInfo& info);
  [[nodiscard]] uint64_t samples() const { return all_.samples(); }
  [[nodiscard]] uint64_t bytes() const { return bytes_; }
  /// Between the first and the last sample; 0 with less than two.
  [[nodiscard]] double bytes_per_s() const;
  [[nodiscard]] std::string line() const;
  [[nodiscard]] nlohmann::ordered_json json() const;

 private:
  TopicStatistics all_;
  uint64_t bytes_ = 0;
  uint64_t smallest_ = 0;
  uint64_t largest_ = 0;
};

class DelayStatistics {
 public:
  explicit DelayStatistics(int64_t since_ns = 0) : since_ns_(since_ns) {}
  void add(const messaging::TopicInfo& topic, const void* sample, const messaging::SampleInfo& info);
  [[nodiscard]] uint64_t samples() const { return on_the_way_ms_.size(); }
  [[nodiscard]] std::string line() const;
  [[nodiscard]] nlohmann::ordered_json json() const;

 private:
  int64_t since_ns_;
  std::vector<double> on_the_way_ms_;     // from sending to receiving
  std::vector<double> since_grabbed_ms_;  // from the grab of the input behind it to receiving, where the type tells it
};

/// As CDR; of a picture only the pixels in use.
uint64_t bytes_of(const messaging::TopicInfo& topic, const void* sample);

}  // namespace railfix::tool
