#include "topic_watch.hpp"

#include <spdlog/fmt/fmt.h>

#include <algorithm>

#include "core/time.hpp"
#include "messaging/topics.hpp"
#include "recording/sample_types.hpp"

namespace railfix::tool {

void TopicStatistics::add(const messaging::TopicInfo& topic, const messaging::SampleInfo& info) {
  if (info.source_ns < since_ns_) {
    ++standing_;
    return;
  }
  lost_ += sequences_.before(info.writer, info.sequence, topic.qos.exclusive);
  if (samples_ == 0) {
    first_ns_ = info.received_ns;
  } else {
    const int64_t gap_ns = info.received_ns - last_ns_;
    shortest_ns_ = samples_ == 1 ? gap_ns : std::min(shortest_ns_, gap_ns);
    longest_ns_ = std::max(longest_ns_, gap_ns);
  }
  last_ns_ = info.received_ns;
  latency_ms_ = core::seconds(info.received_ns - info.source_ns) * 1e3;
  ++samples_;
}

double TopicStatistics::rate_hz() const {
  return samples_ < 2 || last_ns_ <= first_ns_
             ? 0
             : static_cast<double>(samples_ - 1) / core::seconds(last_ns_ - first_ns_);
}
double TopicStatistics::rate_hz(double listened_s) const {
  if (samples_ > 1 && 2 * core::seconds(last_ns_ - first_ns_) >= listened_s) return rate_hz();
  return listened_s > 0 ? static_cast<double>(samples_) / listened_s : 0;
}
double TopicStatistics::shortest_gap_ms() const {
  return core::seconds(shortest_ns_) * 1e3;
}
double TopicStatistics::longest_gap_ms() const {
  return core::seconds(longest_ns_) * 1e3;
}

std::string RateStatistics::line() const {
  return fmt::format("{:.2f} Hz, gaps {:.1f} to {:.1f} ms, {} samples, {} lost, last latency {:.2f} ms", all_.rate_hz(),
                     all_.shortest_gap_ms(), all_.longest_gap_ms(), all_.samples(), all_.lost(), all_.latency_ms());
}

nlohmann::ordered_json RateStatistics::json() const {
  return {{"samples", all_.samples()},
          {"rate_hz", all_.rate_hz()},
          {"shortest_gap_ms", all_.shortest_gap_ms()},
          {"longest_gap_ms", all_.longest_gap_ms()},
          {"lost", all_.lost()},
          {"latency_ms", all_.latency_ms()}};
}

uint64_t bytes_of(const messaging::TopicInfo& topic, const void* sample) {
  constexpr uint64_t kFrameHeadBytes = 48;
  if (topic.type == &messaging::type_of<msg::CameraFrame>()) {
    const auto& frame = *static_cast<const msg::CameraFrame*>(sample);
    return kFrameHeadBytes + uint64_t{frame.width_px()} * frame.height_px();
  }
  return topic.type->serialize(sample).size();
}

void BandwidthStatistics::add(const messaging::TopicInfo& topic, const void* sample,
                              const messaging::SampleInfo& info) {
  const uint64_t bytes = bytes_of(topic, sample);
  smallest_ = all_.samples() == 0 ? bytes : std::min(smallest_, bytes);
  largest_ = std::max(largest_, bytes);
  bytes_ += bytes;
  all_.add(topic, info);
}

double BandwidthStatistics::bytes_per_s() const {
  return all_.samples() == 0 ? 0 : static_cast<double>(bytes_) / static_cast<double>(all_.samples()) * all_.rate_hz();
}

std::string BandwidthStatistics::line() const {
  return fmt::format("{:.2f} kB/s, {} samples of {} to {} bytes", bytes_per_s() / 1e3, all_.samples(), smallest_,
                     largest_);
}

nlohmann::ordered_json BandwidthStatistics::json() const {
  return {{"samples", all_.samples()},
          {"bytes_per_s", bytes_per_s()},
          {"smallest_bytes", smallest_},
          {"largest_bytes", largest_}};
}

void DelayStatistics::add(const messaging::TopicInfo& topic, const void* sample, const messaging::SampleInfo& info) {
  if (info.source_ns < since_ns_) return;
  on_the_way_ms_.push_back(1e3 * core::seconds(info.received_ns - info.source_ns));
  const auto* type = cdr::own_types().find(topic.type->name());
  if (type == nullptr || std::ranges::find(type->members, "grabbed_ns", &cdr::Member::name) == type->members.end()) {
    return;
  }
  if (topic.type == &messaging::type_of<msg::CameraFrame>()) {
    const auto& frame = *static_cast<const msg::CameraFrame*>(sample);
    since_grabbed_ms_.push_back(1e3 * core::seconds(info.received_ns - frame.grabbed_ns()));
    return;
  }
  const auto grabbed_ns = leading_int64(*type, "grabbed_ns", topic.type->serialize(sample));
  if (!grabbed_ns || *grabbed_ns == 0) return;
  since_grabbed_ms_.push_back(1e3 * core::seconds(info.received_ns - *grabbed_ns));
}

namespace {

struct Spread {
  double p50_ms = 0;
  double p95_ms = 0;
  double p99_ms = 0;
  double max_ms = 0;
};

Spread spread_of(std::vector<double> values_ms) {
  if (values_ms.empty()) return {};
  std::ranges::sort(values_ms);
  const auto at = [&](size_t percent) {
    return values_ms[std::min(values_ms.size() - 1, values_ms.size() * percent / 100)];
  };
  return {at(50), at(95), at(99), values_ms.back()};
}

std::string text_of(const Spread& spread) {
  return fmt::format("p50 {:.2f}, p95 {:.2f}, p99 {:.2f}, at most {:.2f} ms", spread.p50_ms, spread.p95_ms,
                     spread.p99_ms, spread.max_ms);
}

nlohmann::ordered_json json_of(const Spread& spread) {
  return {{"p50_ms", spread.p50_ms}, {"p95_ms", spread.p95_ms}, {"p99_ms", spread.p99_ms}, {"max_ms", spread.max_ms}};
}

}  // namespace

std::string DelayStatistics::line() const {
  std::string text = "on the way " + text_of(spread_of(on_the_way_ms_));
  if (!since_grabbed_ms_.empty()) text += "; since the grab " + text_of(spread_of(since_grabbed_ms_));
  return text + fmt::format("; {} samples", samples());
}

nlohmann::ordered_json DelayStatistics::json() const {
  nlohmann::ordered_json json{{"samples", samples()}, {"on_the_way", json_of(spread_of(on_the_way_ms_))}};
  if (!since_grabbed_ms_.empty()) json["since_grabbed"] = json_of(spread_of(since_grabbed_ms_));
  return json;
}

}  // namespace railfix::tool
