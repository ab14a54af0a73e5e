#include "monitor/foxglove_api.hpp"

#include <algorithm>

#include "core/cut_text.hpp"
#include "core/json_text.hpp"
#include "monitor/live_api.hpp"

namespace railfix::monitor {
namespace {

using nlohmann::json;

enum StatusLevel { kInfo = 0, kWarning = 1, kError = 2 };
constexpr char kMessageData = 0x01;

Frame frame_of(const json& message) {
  return {std::make_shared<const std::string>(text_of(message)), false, "", false};
}

Frame status(StatusLevel level, const std::string& text, const std::string& id = "") {
  json message{{"op", "status"}, {"level", static_cast<int>(level)}, {"message", text}};
  if (!id.empty()) message["id"] = id;
  return frame_of(message);
}

void append_little_endian(std::string& bytes, uint64_t value, size_t size) {
  for (size_t i = 0; i < size; ++i) bytes += static_cast<char>(value >> (8 * i) & 0xFFU);
}

std::optional<uint32_t> id_of(const json& value) {
  if (!value.is_number_integer()) return std::nullopt;
  const auto number = value.get<int64_t>();
  if (number < 0 || number > UINT32_MAX) return std::nullopt;
  return static_cast<uint32_t>(number);
}

}  // namespace

std::string foxglove_subprotocol(const std::vector<std::string>& offered) {
  const auto known = [](const std::string& name) {
    return name == "foxglove.sdk.v1" || name == "foxglove.websocket.v1";
  };
  const auto first = std::ranges::find_if(offered, known);
  return first == offered.end() ? "" : *first;
}

std::string base64(std::string_view bytes) {
  constexpr std::string_view kLetters = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  for (size_t i = 0; i < bytes.size(); i += 3) {
    const size_t here = std::min<size_t>(3, bytes.size() - i);
    uint32_t group = 0;
    for (size_t k = 0; k < 3; ++k) group = group << 8U | (k < here ? static_cast<uint8_t>(bytes[i + k]) : 0U);
    for (size_t k = 0; k < 4; ++k) text += k <= here ? kLetters[group >> (18 - 6 * k) & 0x3FU] : '=';
  }
  return text;
}

void FoxgloveApi::opened(const ClientPtr& client) {
  clients_[client->id()] = {client, {}};
  client->send(frame_of({{"op", "serverInfo"},
                         {"name", actions_.name},
                         {"capabilities", json::array()},
                         {"metadata", actions_.metadata},
                         {"sessionId", actions_.metadata.at("session")}}));
  std::vector<std::string> topics;
  for (const auto& [topic, channel] : channels_) {
    if (channel.there) topics.push_back(topic);
  }
  client->send(frame_of(advertise(topics)));
}

void FoxgloveApi::closed(const ClientPtr& client) {
  clients_.erase(client->id());
  gather();
}

json FoxgloveApi::advertise(const std::vector<std::string>& topics) const {
  json channels = json::array();
  for (const auto& topic : topics) {
    const auto& [id, about, there] = channels_.at(topic);
    channels.push_back({{"id", id},
                        {"topic", about.topic},
                        {"encoding", about.encoding},
                        {"schemaName", about.schema_name},
                        {"schema", about.schema_encoding == "protobuf" ? base64(about.schema) : about.schema},
                        {"schemaEncoding", about.schema_encoding}});
  }
  return {{"op", "advertise"}, {"channels", std::move(channels)}};
}

void FoxgloveApi::set_channels(const std::vector<FoxgloveChannel>& channels) {
  std::vector<std::string> added;
  std::set<std::string> here;
  for (const auto& about : channels) {
    here.insert(about.topic);
    const auto [channel, fresh] =
        channels_.try_emplace(about.topic, Channel{static_cast<uint32_t>(channels_.size() + 1), about, true});
    if (fresh || !channel->second.there) added.push_back(about.topic);
    channel->second.there = true;
  }
  json gone = json::array();
  for (auto& [topic, channel] : channels_) {
    if (!channel.there || here.contains(topic)) continue;
    channel.there = false;
    gone.push_back(channel.id);
    for (auto& [id, subscriber] : clients_) {
      std::erase_if(subscriber.topics, [&name = topic](const auto& entry) { return entry.second == name; });
    }
  }
  for (auto& [id, subscriber] : clients_) {
    if (!gone.empty()) subscriber.client->send(frame_of({{"op", "unadvertise"}, {"channelIds", gone}}));
    if (!added.empty()) subscriber.client->send(frame_of(advertise(added)));
  }
  if (!gone.empty()) gather();
}

void FoxgloveApi::message(const ClientPtr& client, const std::string& text, bool binary) {
  const auto found = clients_.find(client->id());
  if (found == clients_.end()) return;
  auto parsed = binary ? core::Result<json>(json()) : core::parse_json(text);
  const json message = parsed.ok() ? std::move(parsed).value() : json();
  if (binary) {
    client->send(
        status(kWarning, "this server takes no binary messages: nothing can be published through it", "binary"));
  } else if (!message.is_object() || !message.contains("op") || !message["op"].is_string()) {
    client->send(status(kError, "this is no message of the Foxglove protocol: a JSON object with `op` is expected"));
  } else if (message["op"] == "subscribe") {
    for (const auto& subscription : message.value("subscriptions", json::array())) {
      subscribe(found->second, subscription);
    }
    gather();
  } else if (message["op"] == "unsubscribe") {
    unsubscribe(found->second, message.value("subscriptionIds", json::array()));
    gather();
  } else {
    const auto op = message["op"].get<std::string>();
    client->send(
        status(kWarning, "this server does not know `" + core::cut_text(op, 40) + "`: it only shows topics", "op"));
  }
  client->resume();
}

void FoxgloveApi::subscribe(Subscriber& subscriber, const json& subscription) {
  const auto refuse = [&](const std::string& why) { subscriber.client->send(status(kError, why)); };
  const auto id = subscription.is_object() ? id_of(subscription.value("id", json())) : std::nullopt;
  const auto channel_id = subscription.is_object() ? id_of(subscription.value("channelId", json())) : std::nullopt;
  if (!id || !channel_id) return refuse("a subscription needs `id` and `channelId`");
  const auto channel = std::ranges::find_if(
      channels_, [&](const auto& entry) { return entry.second.id == *channel_id && entry.second.there; });
  if (channel == channels_.end()) return refuse("there is no channel " + std::to_string(*channel_id));
  const std::string& topic = channel->first;
  const bool twice = subscriber.topics.contains(*id) ||
                     std::ranges::any_of(subscriber.topics, [&](const auto& entry) { return entry.second == topic; });
  if (twice)
    return refuse("channel " + std::to_string(*channel_id) + " or id " + std::to_string(*id) +
                  " is subscribed already");
  subscriber.topics[*id] = topic;
  for (const auto& first : actions_.first(topic)) send(subscriber, *id, channel->second, first);
}

void FoxgloveApi::unsubscribe(Subscriber& subscriber, const json& ids) {
  for (const auto& value : ids) {
    const auto id = id_of(value);
    if (id) subscriber.topics.erase(*id);
  }
}

void FoxgloveApi::gather() {
  std::set<std::string> all;
  for (const auto& [client, subscriber] : clients_) {
    for (const auto& [id, topic] : subscriber.topics) all.insert(topic);
  }
  if (all == watched_) return;
  watched_ = std::move(all);
  actions_.watch_changed();
}

void FoxgloveApi::send(Subscriber& subscriber, uint32_t subscription, const Channel& channel,
                       const FoxgloveMessage& message) {
  std::string bytes(1, kMessageData);
  bytes.reserve(13 + message.payload.size());
  append_little_endian(bytes, subscription, 4);
  append_little_endian(bytes, static_cast<uint64_t>(message.log_time_ns), 8);
  bytes += message.payload;
  subscriber.client->send({std::make_shared<const std::string>(std::move(bytes)), true,
                           channel.about.newest_only ? std::to_string(subscription) : "", true});
}

void FoxgloveApi::publish(const std::string& topic, const FoxgloveMessage& message) {
  if (!watched(topic)) return;
  const auto channel = channels_.find(topic);
  if (channel == channels_.end()) return;
  for (auto& [client, subscriber] : clients_) {
    for (const auto& [id, subscribed] : subscriber.topics) {
      if (subscribed == topic) send(subscriber, id, channel->second, message);
    }
  }
}

// Always in the same words: viewers keep a list of those that differ.
void FoxgloveApi::slow(const ClientPtr& client) {
  if (!clients_.contains(client->id())) return;
  client->send(status(kWarning, "messages are left out: the connection is too slow for what is subscribed", "slow"));
}

}  // namespace railfix::monitor
