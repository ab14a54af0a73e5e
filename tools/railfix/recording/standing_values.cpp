#include "recording/standing_values.hpp"

#include <algorithm>

#include "core/time.hpp"
#include "messaging/topics.hpp"

namespace railfix::tool {

namespace {

// Services show life all the time: of one that has said nothing for so long nothing stands any more.
constexpr int64_t kSilentNs = 10 * core::kNsPerSecond;

}  // namespace

// From that moment backwards, and of each topic only as far as needed: a recording may be hours long.
std::vector<StandingValue> standing_values(mcap::Reader& reader, const std::set<std::string>& topics,
                                           int64_t before_ns) {
  mcap::Selection selection;
  selection.to_ns = before_ns;
  selection.backwards = true;
  for (const auto& [id, channel] : reader.channels()) {
    if (latched(channel) && (topics.empty() || topics.contains(channel.topic))) selection.topics.insert(channel.topic);
  }
  if (selection.topics.empty()) return {};
  SampleTypes types(reader);
  std::map<std::pair<std::string, std::string>, StandingValue> last;  // by topic and key
  auto messages = reader.messages(selection);
  while (const auto message = messages.next()) {
    const auto& channel = reader.channels().at(message->channel_id);
    if (before_ns - message->log_time_ns > kSilentNs && channel.topic == messaging::topics::service_status.name) {
      messages.leave_out(channel.id);
      continue;
    }
    last.try_emplace({channel.topic, types.key(channel, message->data)},
                     StandingValue{channel.id,
                                   message->sequence,
                                   message->log_time_ns,
                                   message->publish_time_ns,
                                   {message->data.begin(), message->data.end()}});
    if (!types.keyed(channel)) messages.leave_out(channel.id);
  }
  std::vector<StandingValue> values;
  values.reserve(last.size());
  for (auto& [what, value] : last) values.push_back(std::move(value));
  std::ranges::stable_sort(values, {}, &StandingValue::log_time_ns);
  return values;
}

}  // namespace railfix::tool
