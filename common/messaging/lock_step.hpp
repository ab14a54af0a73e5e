// What a service says of its own topics in lock step.
#pragma once

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

}  // namespace railfix::messaging
