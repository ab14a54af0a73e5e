#include "monitor/topic_statistics.hpp"

#include <algorithm>

#include "core/quantile.hpp"
#include "core/time.hpp"

namespace railfix::monitor {
namespace {

constexpr int64_t kSliceNs = core::kNsPerSecond / 4;
constexpr int64_t kRateSlices = 20;  // five seconds
constexpr int64_t kLatencyNs = 10 * core::kNsPerSecond;
constexpr size_t kLatencies = 512;
constexpr double kUsualShare = 0.1;  // of a new gap in the usual one
constexpr double kGapFactor = 3;
constexpr double kShortestGapS = 0.02;
constexpr int64_t kHistoryNs = 2 * core::kNsPerSecond;
constexpr int64_t kGoneNs = 60 * core::kNsPerSecond;
constexpr int64_t kStandingGoneNs = 3600 * core::kNsPerSecond;  // such a value may come once in a long while

}  // namespace

bool BeforeListening::was_sent(const SeenSample& sample) {
  if (!standing_) return false;
  Met& met = met_.try_emplace(sample.writer, Met{sample.arrived_ns, 0}).first->second;
  met.last_ns = sample.arrived_ns;
  const bool may_be_old = sample.arrived_ns - met.first_ns < kHistoryNs;
  std::erase_if(met_, [&](const auto& one) { return sample.arrived_ns - one.second.last_ns > kStandingGoneNs; });
  return may_be_old && sample.sent_ns() < since_ns_;
}

TopicStatistics::Slice& TopicStatistics::slice(int64_t at_ns) {
  const int64_t number = at_ns / kSliceNs;
  Slice& found = slices_[static_cast<size_t>(number) % slices_.size()];
  if (found.number != number) found = {number, 0, 0, 0};
  return found;
}

void TopicStatistics::add(const SeenSample& sample) {
  lost_ += sequences_.before(sample.writer, sample.sequence, exclusive_);
  if (samples_ == 0) first_ns_ = sample.arrived_ns;
  note_pace(sample);
  last_ns_ = std::max(last_ns_, sample.arrived_ns);
  forget_gone();
  ++samples_;
  bytes_ += sample.bytes;
  Slice& now = slice(sample.arrived_ns);
  ++now.samples;
  now.bytes += sample.bytes;
  if (sample.source_ns > 0) note_latency(sample);
}

void TopicStatistics::note_pace(const SeenSample& sample) {
  Pace& pace = paces_[exclusive_ ? 0 : sample.writer];
  const int64_t gap_ns = std::max<int64_t>(sample.arrived_ns - pace.last_ns, 0);
  pace.last_ns = std::max(pace.last_ns, sample.arrived_ns);
  if (pace.samples++ == 0) return;
  const double gap_s = core::seconds(gap_ns);
  if (pace.samples > kSamplesToKnow && gap_s > std::max(kGapFactor * pace.usual_gap_s, kShortestGapS)) {
    ++gaps_;
  } else {
    pace.usual_gap_s = pace.samples == 2 ? gap_s : pace.usual_gap_s + kUsualShare * (gap_s - pace.usual_gap_s);
  }
  Slice& now = slice(pace.last_ns);
  now.longest_gap_ns = std::max(now.longest_gap_ns, gap_ns);
}

// A writer that was started anew is another one: the pace of the one before it is nobody's.
void TopicStatistics::forget_gone() {
  std::erase_if(paces_, [this](const auto& one) { return last_ns_ - one.second.last_ns > kGoneNs; });
}

double TopicStatistics::usual_gap_s() const {
  double shortest_s = 0;
  for (const auto& [writer, pace] : paces_) {
    if (pace.samples < kSamplesToKnow) continue;
    shortest_s = shortest_s == 0 ? pace.usual_gap_s : std::min(shortest_s, pace.usual_gap_s);
  }
  return shortest_s;
}

void TopicStatistics::note_latency(const SeenSample& sample) {
  const double latency_s = core::seconds(sample.received_ns - sample.source_ns);
  const auto bound = std::lower_bound(kLatencyBoundsS.begin(), kLatencyBoundsS.end(), latency_s);
  ++latency_counts_[static_cast<size_t>(bound - kLatencyBoundsS.begin())];
  latency_sum_s_ += latency_s;
  if (latencies_.size() < kLatencies) latencies_.emplace_back();
  latencies_[next_latency_ % kLatencies] = {sample.arrived_ns, static_cast<float>(latency_s * 1e3)};
  ++next_latency_;
}

TopicNumbers TopicStatistics::numbers(int64_t now_ns) const {
  TopicNumbers numbers;
  numbers.samples = samples_;
  numbers.bytes = bytes_;
  numbers.lost = lost_;
  numbers.gaps = gaps_;
  if (samples_ == 0) return numbers;
  const int64_t present_gap_ns = std::max<int64_t>(now_ns - last_ns_, 0);
  numbers.age_s = core::seconds(present_gap_ns);
  const int64_t now_slice = now_ns / kSliceNs;
  int64_t longest_ns = samples_ > 1 ? present_gap_ns : 0;
  uint64_t samples = 0;
  uint64_t bytes = 0;
  for (const Slice& one : slices_) {
    const int64_t slices_ago = now_slice - one.number;
    if (one.number < 0 || slices_ago < 0 || slices_ago >= static_cast<int64_t>(slices_.size())) continue;
    longest_ns = std::max(longest_ns, one.longest_gap_ns);
    if (slices_ago == 0 || slices_ago > kRateSlices) continue;  // the present one is not over yet
    samples += one.samples;
    bytes += one.bytes;
  }
  const int64_t since_first_ns = std::max<int64_t>(now_slice * kSliceNs - first_ns_, kSliceNs);
  const double window_s = core::seconds(std::min(kRateSlices * kSliceNs, since_first_ns));
  numbers.hz = static_cast<double>(samples) / window_s;
  numbers.bytes_per_s = static_cast<double>(bytes) / window_s;
  numbers.longest_gap_s = core::seconds(longest_ns);

  std::vector<float> latencies_ms;
  for (const Latency& latency : latencies_) {
    if (now_ns - latency.arrived_ns <= kLatencyNs) latencies_ms.push_back(latency.ms);
  }
  std::ranges::sort(latencies_ms);
  numbers.latency_p50_ms = core::quantile(latencies_ms, 0.50);
  numbers.latency_p95_ms = core::quantile(latencies_ms, 0.95);
  numbers.latency_p99_ms = core::quantile(latencies_ms, 0.99);
  return numbers;
}

}  // namespace railfix::monitor
