// Raw bytes to the monitor's port: HTTP requests and, behind an upgrade, WebSocket frames. The first byte of the input
// chooses. Every connection must come to its end, whatever was sent.
#include <string>

#include "fuzz/fuzz_target.hpp"
#include "monitor/http_server.hpp"
#include "support/loopback.hpp"

namespace railfix::monitor {

namespace {

constexpr const char* kUpgrade =
    "GET /api/live HTTP/1.1\r\nHost: localhost\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
    "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n\r\n";

/// Answers what it understood, so that all that was taken out of the bytes is looked at.
class Server {
 public:
  Server() : server_({}, handlers()), port_(server_.listen(0, 0)) { server_.start(); }
  [[nodiscard]] uint16_t port() const { return port_; }

 private:
  static Handlers handlers() {
    Handlers handlers;
    handlers.request = [](const Request& request, const std::function<void(Response)>& answer) {
      Response response;
      response.body = request.method + request.path + request.host + request.if_none_match;
      for (const auto& [key, value] : request.query) response.body += key + "=" + value;
      answer(response);
    };
    handlers.upgrade = [](const Request& request) {
      return Handlers::Upgrade{true, request.subprotocols.empty() ? "" : request.subprotocols.front(), {}};
    };
    handlers.opened = [](const ClientPtr&) {};
    handlers.message = [](const ClientPtr& client, std::string message, bool binary) {
      client->send({std::make_shared<const std::string>(std::move(message)), binary, "", false});
      client->resume();
    };
    handlers.closed = [](const ClientPtr&, const std::string&) {};
    handlers.slow = [](const ClientPtr&) {};
    return handlers;
  }
  HttpServer server_;
  uint16_t port_;
};

void talk(uint16_t port, const std::string& bytes) {
  const int connection = test::tcp_socket();
  fuzz::require(test::connect_to_loopback(connection, port), "the server is there");
  const timeval patience{60, 0};
  setsockopt(connection, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
  (void)send(connection, bytes.data(), bytes.size(), MSG_NOSIGNAL);
  shutdown(connection, SHUT_WR);
  char part[4096];
  ssize_t got = 0;
  while ((got = recv(connection, part, sizeof part, 0)) > 0) {
  }
  fuzz::require(got == 0 || errno != EAGAIN, "a connection comes to its end");
  close(connection);
}

}  // namespace

}  // namespace railfix::monitor

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace railfix::monitor;
  static const Server server;
  if (size == 0) return 0;
  const std::string bytes(reinterpret_cast<const char*>(data + 1), size - 1);
  talk(server.port(), data[0] % 2 == 0 ? bytes : kUpgrade + bytes);
  return 0;
}
