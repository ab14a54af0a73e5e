// The Foxglove WebSocket protocol, server side (subprotocols foxglove.sdk.v1 and foxglove.websocket.v1, whose frames
// are the same): channels are advertised, and sent to those who subscribe. Knows no socket and no topic.
#pragma once

#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <span>

#include "monitor/http_types.hpp"

namespace railfix::monitor {

/// The subprotocol to answer with: the one that the client likes best (its order, RFC 6455, 1.9) of those that are
/// known; empty = none is. Lichtblick offers both, but its client library up to 0.7.4 refuses any but
/// `foxglove.websocket.v1`.
std::string foxglove_subprotocol(const std::vector<std::string>& offered);

struct FoxgloveChannel {
  std::string topic;
  std::string encoding;     // "cdr", "protobuf"
  std::string schema_name;  // "railfix::msg::TrainState"
  std::string schema;       // text; the bytes of a FileDescriptorSet for protobuf
  std::string schema_encoding;
  bool newest_only = false;  // pictures: a newer one takes the place of one that still waits
};

struct FoxgloveMessage {
  int64_t log_time_ns = 0;
  std::string payload;
};

class FoxgloveApi {
 public:
  struct Actions {
    std::string name;  // of the server
    std::map<std::string, std::string> metadata;
    std::function<void()> watch_changed;
    /// What a new subscriber gets at once: the standing value of a topic that has one.
    std::function<std::vector<FoxgloveMessage>(const std::string& topic)> first;
  };
  explicit FoxgloveApi(Actions actions) : actions_(std::move(actions)) {}

  void opened(const ClientPtr& client);
  void closed(const ClientPtr& client);
  void message(const ClientPtr& client, const std::string& message, bool binary);
  /// Tells a client that messages were left out for it.
  void slow(const ClientPtr& client);

  /// All channels that there are now; clients are told what is new and what is gone.
  void set_channels(const std::vector<FoxgloveChannel>& channels);
  [[nodiscard]] bool watched(const std::string& topic) const { return watched_.contains(topic); }
  [[nodiscard]] const std::set<std::string>& watched() const { return watched_; }
  void publish(const std::string& topic, const FoxgloveMessage& message);

 private:
  struct Subscriber {
    ClientPtr client;
    std::map<uint32_t, std::string> topics;  // by the client's subscription id
  };
  struct Channel {
    uint32_t id = 0;
    FoxgloveChannel about;
    bool there = true;
  };
  void subscribe(Subscriber& subscriber, const nlohmann::json& subscription);
  void unsubscribe(Subscriber& subscriber, const nlohmann::json& ids);
  void send(Subscriber& subscriber, uint32_t subscription, const Channel& channel, const FoxgloveMessage& message);
  void gather();
  [[nodiscard]] nlohmann::json advertise(const std::vector<std::string>& topics) const;

  Actions actions_;
  std::map<std::string, Channel> channels_;  // an id is never used for anything else
  std::map<uint64_t, Subscriber> clients_;
  std::set<std::string> watched_;
};

/// RFC 4648, with padding.
std::string base64(std::string_view bytes);

}  // namespace railfix::monitor
