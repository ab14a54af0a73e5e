#include "replay/channel_choice.hpp"

#include <algorithm>

#include "core/result.hpp"
#include "recording/topic_names.hpp"

namespace railfix::tool {

namespace {

// A recorded command must not start or stop a service of today, an old clock lead none, and an old player is not this
// one.
const std::set<std::string> kOnlyWhenNamed{"service_control", "service_reply", "data_clock", "data_progress",
                                           "player_status"};
// Many write these by nature; whose word it is stands in the sample.
const std::set<std::string> kWrittenByMany{"service_status", "log_record", "service_control", "service_reply",
                                           "data_progress"};

std::string base_of(const std::string& name) {
  return name.substr(0, name.find('/'));
}

bool wanted(const ReplayOptions& options, const std::string& topic) {
  if (names_topic(options.without, topic)) return false;
  return options.topics.empty() ? !kOnlyWhenNamed.contains(topic) : names_topic(options.topics, topic);
}

std::string name_now(const ReplayOptions& options, const std::string& recorded, const messaging::TopicInfo& topic) {
  const auto remap = options.remaps.find(recorded);
  if (remap == options.remaps.end()) return recorded;
  const auto* known = messaging::find_topic(remap->second);
  if (known != nullptr && known->type != topic.type) {
    throw core::BadInput("--remap " + recorded + "=" + remap->second + ": " + base_of(remap->second) +
                         " is a topic of another type (" + known->type->name() + ", not " + topic.type->name() + ")");
  }
  return remap->second;
}

uint64_t messages_of(const mcap::Reader& reader, const std::string& topic) {
  uint64_t messages = 0;
  for (const auto& [id, count] : reader.statistics().channel_messages) {
    const auto channel = reader.channels().find(id);
    if (channel != reader.channels().end() && channel->second.topic == topic) messages += count;
  }
  return messages;
}

void refuse_unknown_remaps(const ReplayOptions& options, const std::set<std::string>& recorded) {
  for (const auto& [from, to] : options.remaps) {
    if (recorded.contains(from)) continue;
    throw core::BadInput("--remap " + from + "=" + to + ": " + options.file.string() + " has no topic " + from);
  }
}

}  // namespace

ChannelChoice choose_channels(const mcap::Reader& reader, const ReplayOptions& options,
                              const std::vector<std::string>& written) {
  core::ok_or_throw(check_topics(reader, options.topics));
  core::ok_or_throw(check_left_out(reader, options.without));
  ChannelChoice choice;
  std::string all;
  std::set<std::string> seen;
  for (const auto& [id, channel] : reader.channels()) {
    all += (all.empty() ? "" : ", ") + channel.topic;
    if (!seen.insert(channel.topic).second || !wanted(options, channel.topic)) continue;
    const auto* topic = messaging::find_topic(channel.topic);
    const auto schema = reader.schemas().find(channel.schema_id);
    const std::string type = schema == reader.schemas().end() ? "" : schema->second.name;
    const bool as_jpeg = topic != nullptr && topic->type == &messaging::type_of<msg::CameraFrame>() &&
                         type == messaging::type_of<msg::CameraPreview>().name();
    if (topic == nullptr || channel.message_encoding != "cdr" || (!as_jpeg && type != topic->type->name())) {
      choice.left_out.push_back(channel.topic + " is not a topic of this version (" + type + ") and is left out");
      continue;
    }
    const std::string now = name_now(options, channel.topic, *topic);
    if (std::ranges::find(written, now) != written.end()) {
      if (!options.lock_step.empty()) {
        choice.left_out.push_back(now + " is written by a service of now and is left out");
        continue;
      }
      if (!kWrittenByMany.contains(now)) {
        throw core::BadInput(where(options.network) + " is running: " + now +
                             " has a writer already; replay as another train (--train), other "
                             "topics (--topics, --without) or under another name (--remap)");
      }
    }
    choice.channels.push_back({channel.topic, now, topic, as_jpeg, messages_of(reader, channel.topic)});
  }
  refuse_unknown_remaps(options, seen);
  if (!choice.channels.empty()) return choice;
  throw core::BadInput(options.file.string() + " has none of the wanted topics; it has " +
                       (all.empty() ? "none" : all));
}

}  // namespace railfix::tool
