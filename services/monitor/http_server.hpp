// HTTP/1.1 and WebSocket (RFC 9112, RFC 6455) on one or more ports, in a thread of its own, plain or with TLS. Knows no
// topic and no page.
#pragma once

#include <chrono>
#include <memory>
#include <string>

#include "monitor/http_types.hpp"

namespace railfix::monitor {

struct HttpOptions {
  std::string address = "127.0.0.1";
  size_t client_queue_bytes = 4'000'000;
  double slow_client_s = 10;
  size_t most_clients = 64;
  std::string certificate;  // PEM files for TLS 1.2 and above; both or none
  std::string key;
  std::chrono::milliseconds request_time{10'000};  // in which a request must have come, all of it
  std::chrono::milliseconds taken_time{30'000};    // in which an answer must have been taken, all of it
};

class HttpServer {
 public:
  /// Throws BadInput when certificate and key cannot be used.
  HttpServer(const HttpOptions& options, Handlers handlers);
  ~HttpServer();
  HttpServer(const HttpServer&) = delete;
  HttpServer& operator=(const HttpServer&) = delete;

  /// Takes the port, or the first free one of the `search` after it; gives the one taken. Before start(). Throws
  /// BadInput when all are taken or the address is none of this computer's.
  uint16_t listen(uint16_t port, int search);
  void start();
  [[nodiscard]] size_t clients() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// A name or address, with or without a port, that only this computer's own programs use for it: a page on the internet
/// whose name points here has another.
bool names_this_computer(const std::string& host);

/// Of the page that opens a WebSocket, with its port: "http://localhost:8080" is of "localhost:8080".
std::string host_of(const std::string& origin);

/// "%41" and "+" of a URL.
std::string url_decoded(const std::string& text);

}  // namespace railfix::monitor
