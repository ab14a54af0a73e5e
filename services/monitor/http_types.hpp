// What goes in and out of the HTTP server, without any of its library's types.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

namespace railfix::monitor {

struct Request {
  std::string method;
  std::string path;                          // decoded, without the query
  std::map<std::string, std::string> query;  // decoded
  std::string host;                          // as the client calls us, with port
  std::string origin;                        // of the page that opened a WebSocket, empty = no browser
  std::string if_none_match;
  std::vector<std::string> subprotocols;
  bool local = false;  // from this computer, not through a proxy, and addressed as such, by a page that was too
};

struct Response {
  unsigned status = 200;
  std::string type = "text/plain; charset=utf-8";
  std::string body;
  std::string etag;  // with its quotes, empty = none
  std::string cache_control = "no-store";
  std::shared_ptr<const std::string> shared = nullptr;  // in place of the body: one that many are given
};

/// One WebSocket message to a client.
struct Frame {
  std::shared_ptr<const std::string> bytes;
  bool binary = false;
  std::string slot;        // a waiting frame of the same slot is replaced by this one; empty = keep all
  bool droppable = false;  // may be left out when the client is too slow, which is counted
};

/// A connected WebSocket. All calls from any thread.
class Client {
 public:
  virtual ~Client() = default;
  [[nodiscard]] virtual uint64_t id() const = 0;
  [[nodiscard]] virtual const Request& request() const = 0;
  virtual void send(Frame frame) = 0;
  /// The next message is read only after this: a client cannot send faster than it is answered.
  virtual void resume() = 0;
  /// Says why and closes.
  virtual void close(const std::string& why) = 0;
};
using ClientPtr = std::shared_ptr<Client>;

/// Called in the server's thread; none may block.
struct Handlers {
  /// Answers once, now or later, from any thread.
  std::function<void(const Request&, std::function<void(Response)> answer)> request;
  /// A WebSocket wants in: the subprotocol that it gets (empty = none), or the refusal.
  struct Upgrade {
    bool accepted = false;
    std::string subprotocol;
    Response refusal;
  };
  std::function<Upgrade(const Request&)> upgrade;
  std::function<void(const ClientPtr&)> opened;
  std::function<void(const ClientPtr&, std::string message, bool binary)> message;
  /// `why` is empty when the client went by itself.
  std::function<void(const ClientPtr&, const std::string& why)> closed;
  /// Droppable frames were left out; at most once a second.
  std::function<void(const ClientPtr&)> slow;
  /// One of those above has thrown: its client gets 500 or is closed with 1011, all others go on.
  std::function<void(const std::string& why)> handler_failed;
  /// The server itself has thrown, and is not to be relied on any more.
  std::function<void(const std::string& why)> server_failed;
};

}  // namespace railfix::monitor
