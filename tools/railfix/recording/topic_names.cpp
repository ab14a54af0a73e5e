#include "recording/topic_names.hpp"

#include <algorithm>

#include "core/similar_names.hpp"
#include "messaging/topics.hpp"

namespace railfix::tool {

bool names_topic(const std::vector<std::string>& names, const std::string& topic) {
  return std::ranges::any_of(names,
                             [&](const std::string& name) { return topic == name || topic.starts_with(name + "/"); });
}

core::Status check_topics(const mcap::Reader& reader, const std::vector<std::string>& names) {
  std::vector<std::string> there;
  for (const auto& [id, channel] : reader.channels()) there.push_back(channel.topic);
  for (const auto& name : names) {
    if (std::ranges::any_of(there, [&](const std::string& topic) { return names_topic({name}, topic); })) continue;
    return core::Error{reader.file().string() + " has no topic " + name + "; " +
                       (there.empty() ? "it has none" : core::did_you_mean(name, there))};
  }
  return {};
}

core::Status check_left_out(const mcap::Reader& reader, std::vector<std::string> names) {
  std::erase_if(names, [](const std::string& name) { return messaging::find_topic(name) != nullptr; });
  return check_topics(reader, names);
}

}  // namespace railfix::tool
