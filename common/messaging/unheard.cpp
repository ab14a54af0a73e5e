#include "messaging/unheard.hpp"

#include <algorithm>

#include "core/time.hpp"
#include "messaging/fastdds_types.hpp"
#include "messaging/layout.hpp"
#include "messaging/participant.hpp"

namespace railfix::messaging {

namespace {

// One that went without a word is forgotten by then (kParticipantLeaseS).
constexpr int64_t kGoneNs = 6 * core::kNsPerSecond;

void sort_out(std::vector<std::string>& sentences) {
  std::sort(sentences.begin(), sentences.end());
  sentences.erase(std::unique(sentences.begin(), sentences.end()), sentences.end());
}

std::string name_of(const Participant::Impl& inside, const eprosima::fastrtps::rtps::GUID_t& endpoint,
                    const std::string& otherwise) {
  const auto known = inside.remote_processes.find(endpoint.guidPrefix);
  return known == inside.remote_processes.end() ? otherwise : known->second.name;
}

std::string why_unheard(const Terms& offered, const Terms& wanted, bool layouts_fit) {
  if (!layouts_fit) return ": its release has another layout of this topic (IDL); bring both to one release";
  const auto why = mismatch(offered, wanted);
  return why.empty() ? "" : ", its quality of service does not fit: " + why;
}

}  // namespace

std::vector<std::string> unheard_writers(Participant& participant) {
  auto& inside = participant.impl();
  const std::lock_guard own_lock(inside.own_mutex);
  const std::lock_guard lock(inside.mutex);
  std::vector<std::string> sentences;
  for (const auto* reader : inside.readers) {
    const std::string topic = reader->get_topicdescription()->get_name();
    const Terms wanted = terms_of(reader->get_qos());
    const uint64_t layout = layout_in(reader->get_qos().user_data().data_vec());
    for (const auto& [guid, writer] : inside.remote_writers) {
      if (writer.topic != topic) continue;
      const auto why = why_unheard(writer.terms, wanted, fits(layout, inside.layout_of_writer(number_of(guid))));
      if (why.empty()) continue;
      const auto name = name_of(inside, guid, "");
      sentences.push_back(topic + (name.empty() ? "" : " of " + name) + " is not heard" + why);
    }
  }
  sort_out(sentences);
  return sentences;
}

std::vector<std::string> unreached_readers(Participant& participant) {
  auto& inside = participant.impl();
  const std::lock_guard own_lock(inside.own_mutex);
  const std::lock_guard lock(inside.mutex);
  const int64_t now_ns = core::monotonic_ns();
  std::vector<std::string> sentences;
  for (const auto* writer : inside.writers) {
    const std::string topic = writer->get_topic()->get_name();
    for (const auto& [guid, reader] : inside.remote_readers) {
      const auto& since_ns = reader.out_of_reach_since_ns;
      if (reader.topic != topic || !since_ns || now_ns - *since_ns < kGoneNs) continue;
      sentences.push_back(topic + " does not reach " + name_of(inside, guid, "a reader") +
                          ": run it as the same user and with this one's /dev/shm");
    }
  }
  sort_out(sentences);
  return sentences;
}

}  // namespace railfix::messaging
