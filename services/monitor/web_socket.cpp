#include "monitor/web_socket.hpp"

#include <netinet/tcp.h>

#include <algorithm>

#include "core/cut_text.hpp"
#include "core/time.hpp"

namespace railfix::monitor {
namespace {

namespace beast = boost::beast;
namespace websocket = beast::websocket;
namespace asio = boost::asio;

constexpr size_t kLongestMessage = 64 * 1024;
// Pictures must not pile up in the kernel, where a newer one cannot take their place.
constexpr int kSendBufferBytes = 256 * 1024;
constexpr int kUnsentBytes = 16 * 1024;  // more is not taken by the kernel before the link has carried it
constexpr std::chrono::seconds kWatchPeriod{1};
constexpr std::chrono::seconds kHandshake{10};
constexpr std::chrono::seconds kIdle{30};
constexpr size_t kLongestReason = 120;  // of a close frame: 123 bytes

}  // namespace

template <class Stream>
WebSocket<Stream>::WebSocket(std::shared_ptr<Shared> shared, Stream&& stream, Request request, std::string subprotocol)
    : shared_(std::move(shared)),
      stream_(std::move(stream)),
      watch_(shared_->io),
      id_(shared_->next_id++),
      request_(std::move(request)),
      subprotocol_(std::move(subprotocol)) {
  ++shared_->clients;
}

template <class Stream>
WebSocket<Stream>::~WebSocket() {
  --shared_->clients;
}

template <class Stream>
void WebSocket<Stream>::accept(const HttpRequest& upgrade) {
  beast::get_lowest_layer(stream_).expires_never();
  beast::error_code ignored;
  beast::get_lowest_layer(stream_).socket().set_option(asio::socket_base::send_buffer_size(kSendBufferBytes), ignored);
  beast::get_lowest_layer(stream_).socket().set_option(asio::ip::tcp::no_delay(true), ignored);
  beast::get_lowest_layer(stream_).socket().set_option(
      asio::detail::socket_option::integer<IPPROTO_TCP, TCP_NOTSENT_LOWAT>(kUnsentBytes), ignored);
  stream_.set_option(websocket::stream_base::timeout{kHandshake, kIdle, true});
  stream_.set_option(websocket::stream_base::decorator([protocol = subprotocol_](websocket::response_type& response) {
    if (!protocol.empty()) response.set(beast::http::field::sec_websocket_protocol, protocol);
  }));
  stream_.read_message_max(kLongestMessage);
  stream_.async_accept(upgrade, [self = shared_from_this()](beast::error_code error) {
    if (error) return;
    self->open_ = self->told_ = true;
    self->guarded([&] { self->shared_->handlers.opened(self); });
    self->watch();
    self->read();
  });
}

template <class Stream>
void WebSocket<Stream>::read() {
  if (ended_) return;
  stream_.async_read(buffer_, [self = shared_from_this()](beast::error_code error, size_t) {
    if (error) return self->end("");
    std::string message = beast::buffers_to_string(self->buffer_.data());
    self->buffer_.consume(self->buffer_.size());
    self->guarded([&] { self->shared_->handlers.message(self, std::move(message), self->stream_.got_binary()); });
  });
}

template <class Stream>
void WebSocket<Stream>::resume() {
  asio::post(shared_->io, [self = shared_from_this()] { self->read(); });
}

template <class Stream>
void WebSocket<Stream>::send(Frame frame) {
  asio::post(shared_->io,
             [self = shared_from_this(), frame = std::move(frame)]() mutable { self->queue(std::move(frame)); });
}

template <class Stream>
void WebSocket<Stream>::queue(Frame frame) {
  if (!open_ || ended_) return;
  const auto same = frame.slot.empty() ? waiting_.end()
                                       : std::find_if(waiting_.begin(), waiting_.end(),
                                                      [&](const Frame& waiting) { return waiting.slot == frame.slot; });
  waiting_bytes_ += frame.bytes->size();
  if (same != waiting_.end()) {  // in its place: behind the others it would be overtaken for ever
    waiting_bytes_ -= same->bytes->size();
    *same = std::move(frame);
  } else {
    waiting_.push_back(std::move(frame));
  }
  if (waiting_bytes_ > shared_->options.client_queue_bytes && !make_room()) {
    return say_goodbye("too slow", websocket::close_code::policy_error);
  }
  if (!writing_) write();
}

// Leaves out the oldest of what may be left out.
template <class Stream>
bool WebSocket<Stream>::make_room() {
  for (auto frame = waiting_.begin();
       frame != waiting_.end() && waiting_bytes_ > shared_->options.client_queue_bytes;) {
    if (!frame->droppable) {
      ++frame;
      continue;
    }
    waiting_bytes_ -= frame->bytes->size();
    frame = waiting_.erase(frame);
    ++dropped_;
  }
  return waiting_bytes_ <= shared_->options.client_queue_bytes;
}

template <class Stream>
void WebSocket<Stream>::write() {
  if (waiting_.empty() || ended_) return;
  sending_ = std::move(waiting_.front());
  waiting_.pop_front();
  waiting_bytes_ -= sending_.bytes->size();
  writing_ = true;
  write_begun_ns_ = core::monotonic_ns();
  stream_.binary(sending_.binary);
  stream_.async_write(asio::buffer(*sending_.bytes), [self = shared_from_this()](beast::error_code error, size_t) {
    self->writing_ = false;
    if (error) return self->end("");
    self->write();
  });
}

// Once a second: who takes nothing is let go; who got less than all is told.
template <class Stream>
void WebSocket<Stream>::watch() {
  watch_.expires_after(kWatchPeriod);
  watch_.async_wait([self = shared_from_this()](beast::error_code error) {
    if (error || self->ended_) return;
    if (self->writing_ &&
        core::seconds(core::monotonic_ns() - self->write_begun_ns_) > self->shared_->options.slow_client_s) {
      return self->end("took nothing for " + std::to_string(static_cast<int>(self->shared_->options.slow_client_s)) +
                       " s");
    }
    if (self->dropped_ > self->dropped_told_) {
      self->dropped_told_ = self->dropped_;
      self->guarded([&] { self->shared_->handlers.slow(self); });
    }
    self->watch();
  });
}

template <class Stream>
void WebSocket<Stream>::close(const std::string& why) {
  asio::post(shared_->io,
             [self = shared_from_this(), why] { self->say_goodbye(why, websocket::close_code::policy_error); });
}

template <class Stream>
template <class Call>
void WebSocket<Stream>::guarded(const Call& call) {
  if (!shared_->guarded(call)) say_goodbye("the monitor failed", websocket::close_code::internal_error);
}

template <class Stream>
void WebSocket<Stream>::say_goodbye(const std::string& why, websocket::close_code code) {
  if (ended_) return;
  waiting_.clear();
  waiting_bytes_ = 0;
  if (!open_) return end(why);
  open_ = false;
  why_ = why;
  const websocket::close_reason reason(code, core::cut_text(why, kLongestReason));
  stream_.async_close(reason, [self = shared_from_this(), why](beast::error_code) { self->end(why); });
}

template <class Stream>
void WebSocket<Stream>::end(const std::string& why) {
  if (ended_) return;
  ended_ = true;
  waiting_.clear();
  watch_.cancel();
  beast::error_code ignored;
  beast::get_lowest_layer(stream_).socket().close(ignored);
  if (told_) shared_->guarded([&] { shared_->handlers.closed(shared_from_this(), why.empty() ? why_ : why); });
}

template class WebSocket<PlainStream>;
template class WebSocket<TlsStream>;

}  // namespace railfix::monitor
