// A client that notes what it is sent.
#pragma once

#include <nlohmann/json.hpp>

#include "monitor/http_types.hpp"

namespace railfix::monitor {

class NotedClient : public Client {
 public:
  explicit NotedClient(uint64_t id) : id_(id) {}
  [[nodiscard]] uint64_t id() const override { return id_; }
  [[nodiscard]] const Request& request() const override { return request_; }
  void send(Frame frame) override { frames.push_back(std::move(frame)); }
  void resume() override { ++resumed; }
  void close(const std::string& why) override { closed = why; }

  [[nodiscard]] nlohmann::json message(size_t i) const { return nlohmann::json::parse(*frames.at(i).bytes); }
  [[nodiscard]] nlohmann::json last() const { return message(frames.size() - 1); }

  std::vector<Frame> frames;
  int resumed = 0;
  std::string closed;

 private:
  uint64_t id_;
  Request request_;
};

}  // namespace railfix::monitor
