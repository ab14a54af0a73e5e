#include "monitor/live_api.hpp"

#include "core/json_text.hpp"

namespace railfix::monitor {
namespace {

using nlohmann::json;

constexpr size_t kMostKinds = 64;

Frame frame_of(const json& message) {
  return {std::make_shared<const std::string>(text_of(message)), false, "", false};
}

std::string word(const json& object, const char* key) {
  const auto found = object.find(key);
  return found != object.end() && found->is_string() ? found->get<std::string>() : "";
}

}  // namespace

std::string text_of(const json& json) {
  return core::json_text(json);
}

void LiveApi::opened(const ClientPtr& client) {
  clients_[client->id()] = {client, {}};
  client->send(frame_of(actions_.hello()));
}

void LiveApi::closed(const ClientPtr& client) {
  clients_.erase(client->id());
  gather();
}

void LiveApi::message(const ClientPtr& client, const std::string& text) {
  const auto watcher = clients_.find(client->id());
  if (watcher == clients_.end()) return;
  const auto parsed = core::parse_json(text);
  if (!parsed.ok() || !parsed.value().is_object()) {
    client->close("not a JSON object");
    return;
  }
  const json& message = parsed.value();
  if (const auto kinds = message.find("watch"); kinds != message.end() && kinds->is_array()) {
    change(watcher->second, *kinds);
  }
  if (const auto ask = message.find("control"); ask != message.end() && ask->is_object()) {
    actions_.control(client, {client->id(), ask->value("id", json()), word(*ask, "service"), word(*ask, "command"),
                              word(*ask, "argument"), word(*ask, "token")});
  }
  client->resume();
}

void LiveApi::change(Watcher& watcher, const json& kinds) {
  const auto before = std::exchange(watcher.kinds, {});
  for (const auto& kind : kinds) {
    if (kind.is_string() && watcher.kinds.size() < kMostKinds) watcher.kinds.insert(kind.get<std::string>());
  }
  gather();
  for (const auto& kind : watcher.kinds) {
    if (before.contains(kind)) continue;
    for (const auto& first : actions_.first(kind)) watcher.client->send(frame_of(first));
  }
}

void LiveApi::gather() {
  std::set<std::string> all;
  for (const auto& [id, watcher] : clients_) all.insert(watcher.kinds.begin(), watcher.kinds.end());
  if (all == watched_) return;
  watched_ = std::move(all);
  actions_.watch_changed();
}

void LiveApi::send(const Frame& frame, const std::string& kind) {
  for (const auto& [id, watcher] : clients_) {
    if (watcher.kinds.contains(kind)) watcher.client->send(frame);
  }
}

void LiveApi::publish(const std::string& kind, const json& message, bool every) {
  if (!watched(kind)) return;
  Frame frame = frame_of(message);
  if (!every) frame.slot = kind;
  send(frame, kind);
}

void LiveApi::publish_picture(const std::string& kind, const json& message, const json& header, std::string_view jpeg) {
  if (!watched(kind)) return;
  publish(kind, message);
  const std::string head = text_of(header);
  std::string bytes;
  bytes.reserve(4 + head.size() + jpeg.size());
  for (size_t i = 0; i < 4; ++i) bytes += static_cast<char>(head.size() >> (8 * i) & 0xFFU);
  bytes += head;
  bytes += jpeg;
  send({std::make_shared<const std::string>(std::move(bytes)), true, kind + " picture", false}, kind);
}

void LiveApi::tell_all(const std::string& kind, const json& message) {
  Frame frame = frame_of(message);
  frame.slot = kind;
  for (const auto& [id, watcher] : clients_) watcher.client->send(frame);
}

void LiveApi::reply(uint64_t client, const json& id, bool done, const std::string& text) {
  const auto watcher = clients_.find(client);
  if (watcher == clients_.end()) return;
  watcher->second.client->send(frame_of({{"kind", "reply"}, {"id", id}, {"done", done}, {"text", text}}));
}

}  // namespace railfix::monitor
