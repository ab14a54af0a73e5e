#include "monitor/http_server.hpp"

#include <boost/asio/ip/tcp.hpp>
#include <boost/beast/http/span_body.hpp>
#include <future>
#include <optional>
#include <thread>
#include <type_traits>

#include "core/result.hpp"
#include "monitor/web_socket.hpp"

namespace railfix::monitor {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;
using asio::ip::tcp;
using HttpRequest = http::request<http::string_body>;
using AnswerMessage = http::response<http::span_body<const char>>;

constexpr std::chrono::seconds kAnswerTime{10};
constexpr uint32_t kLongestHeader = 16 * 1024;
constexpr uint64_t kLongestBody = 64 * 1024;
constexpr std::chrono::seconds kStopTime{3};
constexpr std::chrono::milliseconds kAcceptPause{100};
// A browser opens several for a page; the least is for those who ask while others hold theirs.
constexpr size_t kConnectionsPerClient = 4;
constexpr size_t kLeastConnections = 64;

int hex_digit(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  if (c >= 'a' && c <= 'f') return c - 'a' + 10;
  if (c >= 'A' && c <= 'F') return c - 'A' + 10;
  return -1;
}

std::string text_of(beast::string_view text) {
  return {text.data(), text.size()};
}

// Words between commas, over all headers of this name.
std::vector<std::string> words_of(const HttpRequest& from, http::field name) {
  std::vector<std::string> words;
  const auto [begin, end] = from.equal_range(name);
  for (auto header = begin; header != end; ++header) {
    std::string word;
    for (const char c : text_of(header->value()) + ",") {
      if (c == ' ' || c == '\t') continue;
      if (c != ',') {
        word += c;
      } else if (!word.empty()) {
        words.push_back(std::exchange(word, ""));
      }
    }
  }
  return words;
}

Request request_of(const HttpRequest& from, const tcp::endpoint& peer) {
  Request request;
  request.method = text_of(from.method_string());
  const std::string target = text_of(from.target());
  const size_t question = target.find('?');
  request.path = url_decoded(target.substr(0, question));
  if (question != std::string::npos) {
    std::string rest = target.substr(question + 1);
    while (!rest.empty()) {
      const size_t end = std::min(rest.find('&'), rest.size());
      const std::string pair = rest.substr(0, end);
      const size_t equals = std::min(pair.find('='), pair.size());
      request.query[url_decoded(pair.substr(0, equals))] =
          equals < pair.size() ? url_decoded(pair.substr(equals + 1)) : "";
      rest.erase(0, end + 1);
    }
  }
  request.host = text_of(from[http::field::host]);
  request.origin = text_of(from[http::field::origin]);
  request.if_none_match = text_of(from[http::field::if_none_match]);
  request.subprotocols = words_of(from, http::field::sec_websocket_protocol);
  const bool proxied = from.count("X-Forwarded-For") + from.count("Forwarded") + from.count("Via") > 0;
  const bool own_page = request.origin.empty() || names_this_computer(host_of(request.origin));
  request.local = peer.address().is_loopback() && !proxied && names_this_computer(request.host) && own_page;
  return request;
}

Response said(unsigned status, const std::string& sentence) {
  return {status, "text/plain; charset=utf-8", sentence + "\n", "", "no-store"};
}

// Of the body it has no copy.
AnswerMessage message_of(const Response& response, const std::string& body, bool head, bool keep_alive) {
  AnswerMessage message{static_cast<http::status>(response.status), 11};
  message.set(http::field::content_type, response.type);
  message.set(http::field::cache_control, response.cache_control);
  message.set("X-Content-Type-Options", "nosniff");
  if (!response.etag.empty()) message.set(http::field::etag, response.etag);
  message.keep_alive(keep_alive);
  if (response.status == 304) return message;
  message.content_length(body.size());
  if (!head) message.body() = {body.data(), body.size()};
  return message;
}

/// One connection until it ends or becomes a WebSocket. `Stream` is PlainStream or TlsStream.
template <class Stream>
class HttpSession final : public Session, public std::enable_shared_from_this<HttpSession<Stream>> {
 public:
  HttpSession(std::shared_ptr<Shared> shared, Stream&& stream)
      : shared_(std::move(shared)), stream_(std::move(stream)) {}

  void begin() {
    if constexpr (std::is_same_v<Stream, PlainStream>) {
      read();
    } else {
      tcp().expires_after(shared_->options.request_time);
      stream_.async_handshake(asio::ssl::stream_base::server, [self = shared_from_this()](beast::error_code error) {
        if (error) return self->stop();
        self->read();
      });
    }
  }

  void read() {
    parser_.emplace();
    parser_->header_limit(kLongestHeader);
    parser_->body_limit(kLongestBody);
    tcp().expires_after(shared_->options.request_time);
    http::async_read(stream_, buffer_, *parser_, [self = shared_from_this()](beast::error_code error, size_t) {
      if (error) return self->stop();
      self->handle();
    });
  }
  void stop() override {
    if (upgraded_) return;
    patience_.cancel();
    beast::error_code ignored;
    tcp().socket().close(ignored);
  }
  [[nodiscard]] bool gives_way() const override { return !upgraded_; }

 private:
  using std::enable_shared_from_this<HttpSession>::shared_from_this;
  PlainStream& tcp() { return beast::get_lowest_layer(stream_); }

  void handle() {
    beast::error_code failed;
    const auto peer = tcp().socket().remote_endpoint(failed);
    if (failed) return stop();
    const auto& message = parser_->get();
    // The other forms of a target are for proxies (RFC 9112, 3.2).
    if (!message.target().starts_with('/')) return refuse(said(400, "the target of a request must begin with /"));
    request_ = request_of(message, peer);
    if (beast::websocket::is_upgrade(message)) return upgrade();
    const bool keep_alive = message.keep_alive();
    const uint64_t number = ++requests_;
    // An answer that never comes is one too.
    tcp().expires_never();
    patience_.expires_after(kAnswerTime);
    patience_.async_wait([self = shared_from_this(), number, keep_alive](beast::error_code error) {
      if (!error) self->answer(number, keep_alive, said(503, "the monitor is too busy"));
    });
    const auto answered = [self = shared_from_this(), number, keep_alive](Response response) {
      asio::post(self->shared_->io, [self, number, keep_alive, response = std::move(response)]() mutable {
        self->answer(number, keep_alive, std::move(response));
      });
    };
    if (!shared_->guarded([&] { shared_->handlers.request(request_, answered); })) {
      answer(number, keep_alive, said(500, "the monitor failed at this request"));
    }
  }

  void refuse(const Response& refusal) { answer(++requests_, false, refusal); }

  void answer(uint64_t number, bool keep_alive, Response response) {
    if (number != requests_ || answered_ == number) return;
    answered_ = number;
    patience_.cancel();
    body_ = response.shared ? response.shared : std::make_shared<const std::string>(std::move(response.body));
    response_ = message_of(response, *body_, request_.method == "HEAD", keep_alive);
    tcp().expires_after(shared_->options.taken_time);
    http::async_write(stream_, response_, [self = shared_from_this()](beast::error_code error, size_t) {
      self->body_.reset();
      if (error || self->response_.need_eof()) return self->stop();
      self->read();
    });
  }

  void upgrade() {
    Handlers::Upgrade decision{false, "", said(500, "the monitor failed at this request")};
    shared_->guarded([&] { decision = shared_->handlers.upgrade(request_); });
    if (!decision.accepted) return refuse(decision.refusal);
    if (shared_->clients >= shared_->options.most_clients) {
      return refuse(said(503, "there are too many viewers already"));
    }
    upgraded_ = true;
    const auto socket =
        std::make_shared<WebSocket<Stream>>(shared_, std::move(stream_), request_, decision.subprotocol);
    shared_->sessions.emplace_back(socket);
    socket->accept(parser_->get());
  }

  std::shared_ptr<Shared> shared_;  // goes last
  Stream stream_;
  asio::steady_timer patience_{shared_->io};
  beast::flat_buffer buffer_;
  std::optional<http::request_parser<http::string_body>> parser_;
  Request request_;
  std::shared_ptr<const std::string> body_;
  AnswerMessage response_;
  uint64_t requests_ = 0;
  uint64_t answered_ = 0;
  bool upgraded_ = false;  // the stream is a WebSocket's
};

}  // namespace

struct HttpServer::Impl {
  std::shared_ptr<Shared> shared = std::make_shared<Shared>();
  std::vector<std::shared_ptr<tcp::acceptor>> acceptors;
  std::thread thread;
  std::promise<void> ended;

  void accept(const std::shared_ptr<tcp::acceptor>& acceptor) {
    acceptor->async_accept([this, acceptor](beast::error_code error, tcp::socket socket) {
      if (error == asio::error::operation_aborted || !acceptor->is_open()) return;
      if (error) return accept_later(acceptor);
      make_way();
      if (shared->tls) {
        open<TlsStream>(TlsStream(PlainStream(std::move(socket)), *shared->tls));
      } else {
        open<PlainStream>(PlainStream(std::move(socket)));
      }
      accept(acceptor);
    });
  }

  // Descriptors have run out; the next try would fail at once, too.
  void accept_later(const std::shared_ptr<tcp::acceptor>& acceptor) {
    close_oldest();
    const auto pause = std::make_shared<asio::steady_timer>(shared->io, kAcceptPause);
    pause->async_wait([this, acceptor, pause](beast::error_code) { accept(acceptor); });
  }

  void make_way() {
    auto& sessions = shared->sessions;
    std::erase_if(sessions, [](const auto& session) { return session.expired(); });
    const size_t most = std::max(kConnectionsPerClient * shared->options.most_clients, kLeastConnections);
    while (sessions.size() >= most && close_oldest()) {
    }
  }

  // Who has just come is answered long before it is the oldest, so a flood shuts nobody out; a limit for each address
  // would, as all behind a proxy have the same.
  bool close_oldest() {
    auto& sessions = shared->sessions;
    for (auto oldest = sessions.begin(); oldest != sessions.end(); ++oldest) {
      const auto session = oldest->lock();
      if (!session || !session->gives_way()) continue;
      sessions.erase(oldest);
      session->stop();
      return true;
    }
    return false;
  }

  template <class Stream>
  void open(Stream stream) {
    const auto session = std::make_shared<HttpSession<Stream>>(shared, std::move(stream));
    shared->sessions.emplace_back(session);
    session->begin();
  }

  // A failure is told, which ends the service; until then, and for the goodbyes, it goes on.
  void run() {
    for (bool done = false; !done;) {
      try {
        shared->io.run();
        done = true;
      } catch (const std::exception& error) {
        if (shared->handlers.server_failed) shared->handlers.server_failed(error.what());
      }
    }
    ended.set_value();
  }

  void stop() {
    for (const auto& acceptor : acceptors) acceptor->close();
    for (const auto& weak : shared->sessions) {
      if (const auto session = weak.lock()) session->stop();
    }
  }
};

HttpServer::HttpServer(const HttpOptions& options, Handlers handlers) : impl_(std::make_unique<Impl>()) {
  impl_->shared->options = options;
  impl_->shared->handlers = std::move(handlers);
  if (options.certificate.empty() && options.key.empty()) return;
  if (options.certificate.empty() || options.key.empty()) {
    throw core::BadInput("monitor.tls_certificate and monitor.tls_key belong together; give both or none");
  }
  auto& tls = impl_->shared->tls.emplace(asio::ssl::context::tls_server);
  tls.set_options(asio::ssl::context::default_workarounds | asio::ssl::context::no_tlsv1 |
                  asio::ssl::context::no_tlsv1_1);
  beast::error_code error;
  tls.use_certificate_chain_file(options.certificate, error);
  if (error) {
    throw core::BadInput("monitor.tls_certificate " + options.certificate +
                         " is no certificate in PEM: " + error.message());
  }
  tls.use_private_key_file(options.key, asio::ssl::context::pem, error);
  if (error) {
    throw core::BadInput("monitor.tls_key " + options.key +
                         " is no key in PEM that fits the certificate: " + error.message());
  }
}

HttpServer::~HttpServer() {
  if (!impl_->thread.joinable()) return;
  asio::post(impl_->shared->io, [this] { impl_->stop(); });
  // Whoever does not take our goodbye is left behind.
  if (impl_->ended.get_future().wait_for(kStopTime) != std::future_status::ready) impl_->shared->io.stop();
  impl_->thread.join();
}

uint16_t HttpServer::listen(uint16_t port, int search) {
  const std::string& text = impl_->shared->options.address;
  beast::error_code error;
  const auto address = asio::ip::make_address(text, error);
  if (error) throw core::BadInput("monitor.address " + text + " is no IP address; give one such as 127.0.0.1");
  const int last = port == 0 ? 0 : std::min(port + search, 65535);
  for (int tried = port; tried <= last; ++tried) {
    auto acceptor = std::make_shared<tcp::acceptor>(impl_->shared->io);
    const tcp::endpoint endpoint(address, static_cast<uint16_t>(tried));
    acceptor->open(endpoint.protocol(), error);
    if (!error) acceptor->set_option(asio::socket_base::reuse_address(true), error);
    if (!error) acceptor->bind(endpoint, error);
    if (!error) acceptor->listen(asio::socket_base::max_listen_connections, error);
    if (!error) {
      impl_->acceptors.push_back(acceptor);
      return acceptor->local_endpoint().port();
    }
    if (error != asio::error::address_in_use) {
      throw core::BadInput(text + ":" + std::to_string(tried) + " cannot be listened on: " + error.message() +
                           "; set monitor.address to an address of this computer and monitor.port above 1023");
    }
  }
  throw core::BadInput("port " + std::to_string(port) + " of " + text + " is taken" +
                       (last > port ? ", and so are those up to " + std::to_string(last) : std::string()) +
                       "; set monitor.port to a free one");
}

void HttpServer::start() {
  for (const auto& acceptor : impl_->acceptors) impl_->accept(acceptor);
  impl_->thread = std::thread([this] { impl_->run(); });
}

size_t HttpServer::clients() const {
  return impl_->shared->clients;
}

bool names_this_computer(const std::string& host) {
  const bool bracketed = host.starts_with('[');
  const bool bare_v6 = !bracketed && host.find(':') != host.rfind(':');
  const std::string name = bracketed ? host.substr(1, host.find(']') - 1)
                           : bare_v6 ? host
                                     : host.substr(0, host.find(':'));
  // Only an address itself: a name such as 127.example.org is somebody's, and may point here (DNS rebinding).
  beast::error_code no_address;
  const auto address = asio::ip::make_address(name, no_address);
  return name == "localhost" || (!no_address && address.is_loopback());
}

std::string host_of(const std::string& origin) {
  const size_t scheme = origin.find("://");
  return scheme == std::string::npos ? origin : origin.substr(scheme + 3);
}

std::string url_decoded(const std::string& text) {
  std::string decoded;
  for (size_t i = 0; i < text.size(); ++i) {
    if (text[i] == '%' && i + 2 < text.size() && hex_digit(text[i + 1]) >= 0 && hex_digit(text[i + 2]) >= 0) {
      decoded += static_cast<char>(16 * hex_digit(text[i + 1]) + hex_digit(text[i + 2]));
      i += 2;
    } else {
      decoded += text[i] == '+' ? ' ' : text[i];
    }
  }
  return decoded;
}

}  // namespace railfix::monitor
