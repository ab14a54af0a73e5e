// The protocol of /api/live: who watches what, and everyone gets that and nothing else. Knows no socket and no topic;
// the frames are described in docs/monitor.md.
#pragma once

#include <map>
#include <nlohmann/json.hpp>
#include <set>

#include "monitor/http_types.hpp"

namespace railfix::monitor {

struct ControlAsk {
  uint64_t client = 0;
  nlohmann::json id;  // as the client counts
  std::string service;
  std::string command;
  std::string argument;
  std::string token;
};

class LiveApi {
 public:
  struct Actions {
    std::function<nlohmann::json()> hello;
    /// What a client gets at once when it begins to watch this.
    std::function<std::vector<nlohmann::json>(const std::string& kind)> first;
    std::function<void()> watch_changed;
    std::function<void(const ClientPtr&, const ControlAsk&)> control;
  };
  explicit LiveApi(Actions actions) : actions_(std::move(actions)) {}

  void opened(const ClientPtr& client);
  void closed(const ClientPtr& client);
  void message(const ClientPtr& client, const std::string& text);

  [[nodiscard]] bool watched(const std::string& kind) const { return watched_.contains(kind); }
  [[nodiscard]] const std::set<std::string>& watched() const { return watched_; }

  /// To everyone who watches `kind`. A client that is behind gets the newest only, unless it must have `every` one.
  void publish(const std::string& kind, const nlohmann::json& message, bool every = false);
  /// The message, then the picture as a binary frame with its header.
  void publish_picture(const std::string& kind, const nlohmann::json& message, const nlohmann::json& header,
                       std::string_view jpeg);
  /// To every client, whatever it watches.
  void tell_all(const std::string& kind, const nlohmann::json& message);
  void reply(uint64_t client, const nlohmann::json& id, bool done, const std::string& text);

 private:
  struct Watcher {
    ClientPtr client;
    std::set<std::string> kinds;
  };
  void change(Watcher& watcher, const nlohmann::json& kinds);
  void gather();
  void send(const Frame& frame, const std::string& kind);

  Actions actions_;
  std::map<uint64_t, Watcher> clients_;
  std::set<std::string> watched_;
};

/// NaN as null, letters that are no UTF-8 replaced.
std::string text_of(const nlohmann::json& json);

}  // namespace railfix::monitor
