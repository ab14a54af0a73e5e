#include "ground_link/mqtt_client.hpp"

#include <mosquitto.h>
#include <mqtt_protocol.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <chrono>
#include <condition_variable>
#include <cstring>
#include <mutex>
#include <thread>

#include "core/joined.hpp"
#include "core/whole_file.hpp"
#include "ground_link/name_lookup.hpp"

namespace railfix::ground_link {

namespace {

constexpr int kQos1 = 1;
constexpr int kLoopMs = 200;
constexpr int kHangUpMs = 2000;
constexpr double kFirstRetryS = 0.1;
constexpr int kIdBits = 16;
constexpr int kMostConnections = 0x7FFF;  // that ids can tell apart
constexpr int kFirstFailure = 0x80;       // of MQTT 5's reason codes
constexpr int kSuspicious = 3;            // connections in a row that ended soon, with nothing confirmed
using Clock = std::chrono::steady_clock;

std::string text_of(int code) {
  if (code == MOSQ_ERR_ERRNO) return std::strerror(errno);
  if (code == MOSQ_ERR_UNKNOWN) return "the connection broke";
  std::string text = mosquitto_strerror(code);  // some are sentences
  if (text.ends_with('.')) text.pop_back();
  return text;
}

std::string refusal_text(int code) {
  return code >= kFirstFailure ? mosquitto_reason_string(code) : mosquitto_connack_string(code);
}

struct Free {
  void operator()(mosquitto* client) const { mosquitto_destroy(client); }
};

}  // namespace

class MqttClient::Connection {
 public:
  Connection(const MqttOptions& options, MqttEvents events) : options_(options), events_(std::move(events)) {
    core::ok_or_throw(check_tls(options));
    static const int initialised = mosquitto_lib_init();
    (void)initialised;
    make_client();
    thread_ = std::thread([this] { run(); });
  }
  ~Connection() {
    {
      const std::lock_guard lock(mutex_);
      stop_ = true;
    }
    wake_.notify_all();
    {
      const std::lock_guard lock(client_mutex_);
      mosquitto_disconnect(client_.get());
    }
    thread_.join();
  }
  core::Result<int> publish(const std::string& topic, std::span<const uint8_t> payload, std::optional<int> over) {
    const std::lock_guard lock(client_mutex_);
    if (!connected_ || (over && *over != connections_)) return core::Error{"not connected"};
    int id = 0;
    ++unconfirmed_;
    const int code = mosquitto_publish(client_.get(), &id, topic.c_str(), static_cast<int>(payload.size()),
                                       payload.data(), kQos1, false);
    if (code != MOSQ_ERR_SUCCESS) {
      --unconfirmed_;
      return core::Error{text_of(code)};
    }
    return own_id(id);
  }
  void give_up(int connection, const std::string& why) {
    const std::lock_guard lock(client_mutex_);
    if (!connected_ || connection != connections_) return;
    given_up_ = why;
    mosquitto_disconnect(client_.get());
  }

 private:
  // Mosquitto counts anew in each connection.
  [[nodiscard]] int own_id(int id) const { return connections_ << kIdBits | id; }

  // One for each connection: Mosquitto's library would repeat what the last one had under way, all at once.
  void make_client() {
    const char* id = options_.client_id.empty() ? nullptr : options_.client_id.c_str();
    const std::lock_guard lock(client_mutex_);
    client_.reset(mosquitto_new(id, !options_.keep_session, this));
    connections_ = (connections_ + 1) & kMostConnections;
    if (!client_) throw core::BadInput("MQTT client id \"" + options_.client_id + "\": " + text_of(MOSQ_ERR_ERRNO));
    mosquitto_threaded_set(client_.get(), true);
    if (!options_.user.empty())
      mosquitto_username_pw_set(client_.get(), options_.user.c_str(), options_.password.c_str());
    set_tls();
    set_callbacks();
  }

  void set_tls() {
    if (options_.ca_file.empty()) return;
    const auto or_null = [](const std::string& file) { return file.empty() ? nullptr : file.c_str(); };
    const int code = mosquitto_tls_set(client_.get(), options_.ca_file.c_str(), nullptr,
                                       or_null(options_.certificate_file), or_null(options_.key_file), nullptr);
    if (code != MOSQ_ERR_SUCCESS) throw core::BadInput(why_no_tls(code));
  }

  /// The library's word for a file that is not there is "invalid arguments".
  [[nodiscard]] std::string why_no_tls(int code) const {
    std::vector<std::string> named;
    for (const auto& file : {options_.ca_file, options_.certificate_file, options_.key_file}) {
      if (file.empty()) continue;
      if (access(file.c_str(), R_OK) != 0) return "TLS of the ground link: " + core::cannot_read(file).message;
      named.push_back(file);
    }
    return "TLS of the ground link: " + core::joined(named) + ": " + text_of(code) + "; are they PEM?";
  }

  void subscribe() {
    const int code = mosquitto_subscribe(client_.get(), nullptr, options_.subscribe_to.c_str(), kQos1);
    if (code != MOSQ_ERR_SUCCESS) give_up_subscription(text_of(code));
  }

  // Without it nothing would ever come over this connection.
  void give_up_subscription(const std::string& why) {
    refusal_ = "it refuses the subscription to \"" + options_.subscribe_to + "\": " + why;
    mosquitto_disconnect(client_.get());
  }

  void established() {
    established_at_ = Clock::now();
    connected_ = true;
    if (events_.connected) events_.connected({version_, connections_, doubt()});
  }

  // Whoever is thrown out as soon as it was let in has not reached more than one that was not let in; but radio
  // contacts are short, and reports go over them.
  void notice_whether_it_lasts() {
    if (lasts_ || !established_at_) return;
    const bool all_confirmed = has_confirmed_ && unconfirmed_ == 0;
    if (!all_confirmed && Clock::now() - *established_at_ < options_.lasting) return;
    const bool doubted = !doubt().empty();
    lasts_ = true;
    retry_s_ = kFirstRetryS;
    ended_soon_ = 0;
    if (doubted && events_.lasts) events_.lasts();
  }

  [[nodiscard]] std::string doubt() const {
    if (ended_soon_ < kSuspicious) return "";
    const std::string text =
        "the connection has ended " + std::to_string(ended_soon_) + " times in a row soon after it began";
    return options_.client_id.empty() ? text : text + ": is another client called " + options_.client_id + "?";
  }

  void set_callbacks() {
    mosquitto_connect_callback_set(client_.get(), [](mosquitto*, void* self, int code) {
      auto& connection = *static_cast<Connection*>(self);
      if (code != 0) {
        connection.refusal_ = refusal_text(code);
        connection.version_is_unknown_ =
            code == CONNACK_REFUSED_PROTOCOL_VERSION || code == MQTT_RC_UNSUPPORTED_PROTOCOL_VERSION;
        return;
      }
      if (connection.options_.subscribe_to.empty()) {
        connection.established();
      } else {
        connection.subscribe();
      }
    });
    mosquitto_subscribe_callback_set(client_.get(), [](mosquitto*, void* self, int, int count, const int* granted) {
      auto& connection = *static_cast<Connection*>(self);
      if (count > 0 && granted[0] >= kFirstFailure) {
        connection.give_up_subscription(refusal_text(granted[0]));
      } else {
        connection.established();
      }
    });
    mosquitto_disconnect_callback_set(client_.get(), [](mosquitto*, void* self, int code) {
      if (code >= kFirstFailure) static_cast<Connection*>(self)->refusal_ = refusal_text(code);
    });
    mosquitto_publish_v5_callback_set(client_.get(),
                                      [](mosquitto*, void* self, int id, int code, const mosquitto_property*) {
                                        static_cast<Connection*>(self)->confirmed(id, code);
                                      });
    mosquitto_message_callback_set(client_.get(), [](mosquitto*, void* self, const mosquitto_message* message) {
      static_cast<Connection*>(self)->take(
          {static_cast<const uint8_t*>(message->payload), static_cast<size_t>(message->payloadlen)});
    });
  }

  // Mosquitto's library has made the confirmation of the message, and writes it behind this callback.
  void take(std::span<const uint8_t> payload) {
    if (ended_) return;
    if (events_.received) events_.received(payload);
    const auto next = events_.next ? events_.next() : MqttNext::go_on;
    if (next == MqttNext::go_on) return;
    ended_ = true;
    if (next == MqttNext::enough) mosquitto_loop_write(client_.get(), 1);
    hang_up();
  }

  // A socket that is closed with something unread makes the other end throw away what it has not read: confirmations.
  void hang_up() {
    const int socket = mosquitto_socket(client_.get());
    shutdown(socket, SHUT_WR);
    std::array<char, 4096> unread;
    pollfd readable{socket, POLLIN, 0};
    while (poll(&readable, 1, kHangUpMs) > 0 && read(socket, unread.data(), unread.size()) > 0) continue;
  }

  void confirmed(int id, int code) {
    if (code < kFirstFailure) has_confirmed_ = true;
    --unconfirmed_;
    if (code == MQTT_RC_NO_MATCHING_SUBSCRIBERS && events_.unheard) {
      events_.unheard(own_id(id));
    } else if (code < kFirstFailure) {
      if (events_.delivered) events_.delivered(own_id(id));
    } else if (events_.refused) {
      events_.refused(own_id(id), {refusal_text(code), code == MQTT_RC_NOT_AUTHORIZED});
    }
  }

  [[nodiscard]] bool stopped() {
    const std::lock_guard lock(mutex_);
    return stop_;
  }

  // Mosquitto's library has no way to connect with MQTT 5 that neither blocks nor lets the broker forget the session.
  [[nodiscard]] MqttVersion best_version() const {
    return options_.keep_session ? MqttVersion::v3_1_1 : MqttVersion::v5;
  }

  void run() {
    version_ = best_version();
    while (!stopped()) {
      const auto why = connect_once();
      if (stopped()) break;
      if (ended_) {
        if (events_.disconnected) events_.disconnected("no more is taken");
        break;
      }
      const bool older = version_is_unknown_ && version_ == MqttVersion::v5;
      version_ = older ? MqttVersion::v3_1_1 : best_version();
      if (older) continue;
      const auto doubted = doubt();
      if (events_.disconnected) events_.disconnected(doubted.empty() ? why : why + "; " + doubted);
      pause();
    }
  }

  // Until it is lost; gives why.
  std::string connect_once() {
    refusal_.clear();
    version_is_unknown_ = false;
    established_at_.reset();
    lasts_ = has_confirmed_ = false;
    unconfirmed_ = 0;
    try {
      make_client();
    } catch (const core::BadInput& error) {  // the certificates were there when this began
      return error.what();
    }
    // Mosquitto asks for the name, too, and its certificate is checked against it; but it waits however long that
    // takes.
    if (const auto known = look_up(options_.host, [this] { return stopped(); }); !known.ok())
      return options_.host + ": " + known.error().message;
    mosquitto_int_option(client_.get(), MOSQ_OPT_PROTOCOL_VERSION, static_cast<int>(version_));
    int code = mosquitto_connect_async(client_.get(), options_.host.c_str(), options_.port, options_.keep_alive_s);
    for (bool over = false; code == MOSQ_ERR_SUCCESS && !over && !stopped();) {
      over = is_given_up();  // and once more through the loop, which says good-bye
      code = mosquitto_loop(client_.get(), kLoopMs, 1);
      notice_whether_it_lasts();
    }
    const std::lock_guard lock(client_mutex_);
    connected_ = false;
    if (!given_up_.empty()) return std::exchange(given_up_, {});
    if (established_at_ && !lasts_ && !has_confirmed_) ++ended_soon_;
    if (!refusal_.empty()) return refusal_;
    return code == MOSQ_ERR_KEEPALIVE ? silent() : text_of(code);
  }

  [[nodiscard]] bool is_given_up() {
    const std::lock_guard lock(client_mutex_);
    return !given_up_.empty();
  }

  // Mosquitto's library has no words for it.
  [[nodiscard]] std::string silent() const {
    return "it has not answered for " + std::to_string(options_.keep_alive_s) + " s";
  }

  void pause() {
    std::unique_lock lock(mutex_);
    wake_.wait_for(lock, std::chrono::duration<double>(retry_s_), [this] { return stop_; });
    retry_s_ = std::min(retry_s_ * 2, options_.longest_retry_s);
  }

  MqttOptions options_;
  MqttEvents events_;
  std::mutex client_mutex_;
  std::unique_ptr<mosquitto, Free> client_;
  std::atomic<bool> connected_ = false;
  std::atomic<int> connections_ = 0;
  std::string given_up_;           // why this connection is
  double retry_s_ = kFirstRetryS;  // from here on the thread's own, until mutex_
  std::string refusal_;
  std::optional<Clock::time_point> established_at_;  // this connection
  bool lasts_ = false;
  bool has_confirmed_ = false;        // something, over this connection
  std::atomic<int> unconfirmed_ = 0;  // of what was published over it; any thread
  int ended_soon_ = 0;                // connections in a row over which nothing was confirmed
  MqttVersion version_ = MqttVersion::v5;
  bool version_is_unknown_ = false;  // to the broker
  bool ended_ = false;               // by MqttNext
  std::mutex mutex_;
  std::condition_variable wake_;
  bool stop_ = false;
  std::thread thread_;
};

MqttClient::MqttClient(const MqttOptions& options, MqttEvents events)
    : connection_(std::make_unique<Connection>(options, std::move(events))) {}
MqttClient::~MqttClient() = default;

core::Result<int> MqttClient::publish(const std::string& topic, std::span<const uint8_t> payload,
                                      std::optional<int> connection) {
  return connection_->publish(topic, payload, connection);
}

void MqttClient::give_up(int connection, const std::string& why) {
  connection_->give_up(connection, why);
}

core::Status check_topic(const std::string& topic) {
  const auto bytes = static_cast<int>(topic.size());
  if (!topic.empty() && mosquitto_pub_topic_check(topic.c_str()) == MOSQ_ERR_SUCCESS &&
      mosquitto_validate_utf8(topic.data(), bytes) == MOSQ_ERR_SUCCESS)
    return {};
  return core::Error{"\"" + topic + "\" is no topic to write to: give 1 to 65535 bytes of UTF-8 without + and #."};
}

}  // namespace railfix::ground_link
