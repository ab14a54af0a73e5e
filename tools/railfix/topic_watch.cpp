#include "topic_watch.hpp"

#include <algorithm>
#include <numeric>

#include "core/time.hpp"

namespace railfix::tool {

namespace {

/// Edit distance: how many letters must be put in, taken out or changed (Wagner and Fischer 1974).
size_t distance(const std::string& a, const std::string& b) {
  std::vector<size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), size_t{0});
  for (size_t i = 1; i <= a.size(); ++i) {
    size_t diagonal = row[0];
    row[0] = i;
    for (size_t j = 1; j <= b.size(); ++j) {
      const size_t changed = diagonal + (a[i - 1] == b[j - 1] ? 0 : 1);
      diagonal = row[j];
      row[j] = std::min({changed, row[j] + 1, row[j - 1] + 1});
    }
  }
  return row[b.size()];
}

}  // namespace

void TopicStatistics::add(const messaging::SampleInfo& info) {
  if (!info.valid) return;
  const auto [last, first_of_writer] = last_sequence_.try_emplace(info.writer, info.sequence);
  if (!first_of_writer) {
    if (info.sequence > last->second + 1) lost_ += info.sequence - last->second - 1;
    last->second = std::max(last->second, info.sequence);
  }
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
double TopicStatistics::shortest_gap_ms() const {
  return core::seconds(shortest_ns_) * 1e3;
}
double TopicStatistics::longest_gap_ms() const {
  return core::seconds(longest_ns_) * 1e3;
}

std::vector<std::string> similar_names(const std::string& wanted, const std::vector<std::string>& names) {
  constexpr size_t kMost = 5;
  std::vector<std::pair<size_t, std::string>> ranked;
  for (const auto& name : names) {
    const bool part =
        !wanted.empty() && (name.find(wanted) != std::string::npos || wanted.find(name) != std::string::npos);
    const size_t changes = part ? 1 : distance(wanted, name);
    if (changes <= std::max<size_t>(2, wanted.size() / 3)) ranked.emplace_back(changes, name);
  }
  std::ranges::sort(ranked);
  std::vector<std::string> similar;
  for (const auto& [changes, name] : ranked) {
    if (similar.size() < kMost) similar.push_back(name);
  }
  return similar;
}

}  // namespace railfix::tool
