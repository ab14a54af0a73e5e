#include "service/turns.hpp"

#include <algorithm>
#include <tuple>

namespace railfix::service {

void Turns::reads(const std::string& topic) {
  topics_.try_emplace(topic, Topic{topics_.size()});
}

void Turns::keep(const std::string& topic, uint64_t sequence, int64_t stamp_ns, Work work) {
  Topic& of = topics_.at(topic);
  of.received = std::max(of.received, sequence);
  samples_.push_back({stamp_ns, of.place, sequence, std::move(work)});
}

bool Turns::ready() const {
  return std::all_of(topics_.begin(), topics_.end(), [this](const auto& topic) {
    const auto sent = sent_.find(topic.first);
    return sent == sent_.end() || sent->second <= topic.second.received;
  });
}

std::vector<Turns::Work> Turns::take() {
  std::sort(samples_.begin(), samples_.end(), [](const Sample& a, const Sample& b) {
    return std::tie(a.stamp_ns, a.topic, a.sequence) < std::tie(b.stamp_ns, b.topic, b.sequence);
  });
  std::vector<Work> work;
  work.reserve(samples_.size());
  for (Sample& sample : samples_) work.push_back(std::move(sample.work));
  samples_.clear();
  return work;
}

}  // namespace railfix::service
