#include "recorder/ring.hpp"

#include "core/time.hpp"

namespace railfix::recorder {

void Ring::add(SamplePtr sample, int64_t now_monotonic_ns) {
  bytes_ += sample->cdr.size();
  samples_.emplace_back(now_monotonic_ns, std::move(sample));
  while (seconds() > most_s_ || bytes_ > most_bytes_) {
    SamplePtr& oldest = samples_.front().second;
    bytes_ -= oldest->cdr.size();
    if (!oldest->standing.empty()) standing_before_[oldest->standing] = std::move(oldest);
    samples_.pop_front();
  }
}

Ring::Snapshot Ring::snapshot() const {
  Snapshot all;
  for (const auto& [key, sample] : standing_before_) all.standing.push_back(sample);
  all.samples.reserve(samples_.size());
  for (const auto& [time, sample] : samples_) all.samples.push_back(sample);
  return all;
}

double Ring::seconds() const {
  return samples_.empty() ? 0 : core::seconds(samples_.back().first - samples_.front().first);
}

}  // namespace railfix::recorder
