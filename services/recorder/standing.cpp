#include "recorder/standing.hpp"

#include "cdr/decode.hpp"

namespace railfix::recorder {

std::string key_of(const ChannelOf& channel, const nlohmann::ordered_json& sample) {
  std::string key = channel.topic;
  const auto* type = cdr::own_types().find(channel.type);
  if (type == nullptr) return key;
  for (const auto& member : type->members) {
    if (member.key && sample.contains(member.name)) key += "\n" + sample[member.name].dump();
  }
  return key;
}

std::string standing_of(const ChannelOf& channel, const std::vector<uint8_t>& cdr) {
  if (channel.metadata.at("transient_local") != "true") return "";
  if (channel.metadata.at("keyed") != "true") return channel.topic;
  const auto sample = cdr::decode(cdr::own_types(), channel.type, cdr);
  return sample.ok() ? key_of(channel, sample.value()) : channel.topic;
}

bool is_said_once(std::string_view topic) {
  return topic == "log_record" || topic == "service_control" || topic == "service_reply";
}

}  // namespace railfix::recorder
