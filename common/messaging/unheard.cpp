#include "messaging/unheard.hpp"

#include <algorithm>

#include "messaging/participant.hpp"

namespace railfix::messaging {

std::vector<std::string> unheard_writers(Participant& participant) {
  auto& inside = participant.impl();
  const std::lock_guard lock(inside.mutex);
  std::vector<std::string> sentences;
  for (const auto* reader : inside.readers) {
    const std::string topic = topic_of(*reader);
    const Terms wanted = terms_of(reader->get_qos());
    for (const auto& [guid, writer] : inside.remote_writers) {
      if (writer.topic != topic) continue;
      const auto why = mismatch(writer.terms, wanted);
      if (why.empty()) continue;
      const auto name = inside.remote_processes.find(guid.guidPrefix);
      sentences.push_back(topic + (name == inside.remote_processes.end() ? "" : " of " + name->second.name) +
                          " is not heard, its quality of service does not fit: " + why);
    }
  }
  std::sort(sentences.begin(), sentences.end());
  sentences.erase(std::unique(sentences.begin(), sentences.end()), sentences.end());
  return sentences;
}

}  // namespace railfix::messaging
