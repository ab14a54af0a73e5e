#include "recording/standing_values.hpp"

#include <algorithm>

namespace railfix::tool {

std::vector<StandingValue> standing_values(mcap::Reader& reader, const std::set<std::string>& topics,
                                           int64_t before_ns) {
  mcap::Selection selection;
  selection.to_ns = before_ns;
  for (const auto& [id, channel] : reader.channels()) {
    if (latched(channel) && (topics.empty() || topics.contains(channel.topic))) selection.topics.insert(channel.topic);
  }
  if (selection.topics.empty()) return {};
  SampleTypes types(reader);
  std::map<std::pair<std::string, std::string>, StandingValue> last;  // by topic and key
  reader.for_each(selection, [&](const mcap::Channel& channel, const mcap::Message& message) {
    last[{channel.topic, types.key(channel, message.data)}] = {channel.id,
                                                               message.sequence,
                                                               message.log_time_ns,
                                                               message.publish_time_ns,
                                                               {message.data.begin(), message.data.end()}};
    return true;
  });
  std::vector<StandingValue> values;
  values.reserve(last.size());
  for (auto& [what, value] : last) values.push_back(std::move(value));
  std::ranges::stable_sort(values, {}, &StandingValue::log_time_ns);
  return values;
}

}  // namespace railfix::tool
