// Private to the HTTP server: one WebSocket client with its bounded queue. Lives in the server's thread.
#pragma once

#include <atomic>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ssl/context.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/ssl.hpp>
#include <boost/beast/websocket.hpp>
#include <boost/beast/websocket/ssl.hpp>
#include <deque>
#include <optional>

#include "monitor/http_server.hpp"

namespace railfix::monitor {

using PlainStream = boost::beast::tcp_stream;
using TlsStream = boost::beast::ssl_stream<PlainStream>;

/// One connection of the server, HTTP or WebSocket.
class Session {
 public:
  virtual ~Session() = default;
  virtual void stop() = 0;
  /// To others, when there are too many connections: viewers have a limit of their own.
  [[nodiscard]] virtual bool gives_way() const = 0;
};

/// What all sessions share. It outlives each of them, because a socket must not outlive its io_context.
struct Shared {
  HttpOptions options;
  Handlers handlers;
  std::optional<boost::asio::ssl::context> tls;  // none = plain
  boost::asio::io_context io{1};
  std::atomic<size_t> clients = 0;
  uint64_t next_id = 1;
  std::vector<std::weak_ptr<Session>> sessions;  // the oldest first

  /// False when the call of a handler has thrown, which is told.
  template <class Call>
  bool guarded(const Call& call) {
    try {
      call();
      return true;
    } catch (const std::exception& error) {
      if (handlers.handler_failed) handlers.handler_failed(error.what());
      return false;
    }
  }
};

/// `Stream` is PlainStream or TlsStream.
template <class Stream>
class WebSocket final : public Client, public Session, public std::enable_shared_from_this<WebSocket<Stream>> {
 public:
  using HttpRequest = boost::beast::http::request<boost::beast::http::string_body>;
  WebSocket(std::shared_ptr<Shared> shared, Stream&& stream, Request request, std::string subprotocol);
  ~WebSocket() override;

  void accept(const HttpRequest& upgrade);
  [[nodiscard]] uint64_t id() const override { return id_; }
  [[nodiscard]] const Request& request() const override { return request_; }
  void send(Frame frame) override;
  void resume() override;
  void close(const std::string& why) override;
  void stop() override { say_goodbye("the monitor stops", boost::beast::websocket::close_code::policy_error); }
  [[nodiscard]] bool gives_way() const override { return false; }

 private:
  using std::enable_shared_from_this<WebSocket>::shared_from_this;
  void read();
  void queue(Frame frame);
  bool make_room();
  void write();
  void watch();
  void end(const std::string& why);
  void say_goodbye(const std::string& why, boost::beast::websocket::close_code code);
  template <class Call>
  void guarded(const Call& call);

  std::shared_ptr<Shared> shared_;  // goes last
  boost::beast::websocket::stream<Stream> stream_;
  boost::beast::flat_buffer buffer_;
  boost::asio::steady_timer watch_;
  uint64_t id_;
  Request request_;
  std::string subprotocol_;
  std::deque<Frame> waiting_;
  size_t waiting_bytes_ = 0;
  Frame sending_;
  bool writing_ = false;
  int64_t write_begun_ns_ = 0;
  uint64_t dropped_ = 0;
  uint64_t dropped_told_ = 0;
  std::string why_;    // it is closed by us
  bool told_ = false;  // that it was opened
  bool open_ = false;
  bool ended_ = false;
};

}  // namespace railfix::monitor
