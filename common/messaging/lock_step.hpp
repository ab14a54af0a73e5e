// What services say of their topics in lock step, and who leads it of all.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "messaging/topics.hpp"

namespace railfix::messaging {

/// How many samples this participant has sent to each topic of data; those of operation take no turns.
inline std::vector<msg::SentSamples> sent_samples(const Participant& participant) {
  std::vector<msg::SentSamples> samples;
  for (const auto& sent : participant.sent()) {
    const TopicInfo* topic = find_topic(sent.topic);
    if (topic == nullptr || topic->idl == "operation") continue;
    samples.emplace_back();
    samples.back().topic(sent.topic);
    samples.back().samples(sent.samples);
  }
  return samples;
}

/// What everybody on the train has sent by now: who leads the lock step collects it and says it with every turn.
class SentTotals {
 public:
  void note(const std::vector<msg::SentSamples>& sent) {
    for (const auto& topic : sent) samples_[topic.topic().c_str()] = topic.samples();
  }
  void say(msg::DataClock& clock) const {
    for (const auto& [topic, samples] : samples_) {
      clock.sent().emplace_back();
      clock.sent().back().topic(topic);
      clock.sent().back().samples(samples);
    }
  }
  [[nodiscard]] uint64_t samples(const std::string& topic) const {
    const auto sent = samples_.find(topic);
    return sent == samples_.end() ? 0 : sent->second;
  }

 private:
  std::map<std::string, uint64_t> samples_;
};

}  // namespace railfix::messaging
