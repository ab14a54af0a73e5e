// A connection to an MQTT broker that is made again by itself. Each begins with MQTT 5, in which the broker says what
// it refuses, and goes over to 3.1.1 with a broker that knows only that. Mosquitto's headers appear only in
// mqtt_client.cpp.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "core/result.hpp"

namespace railfix::ground_link {

struct MqttOptions {
  std::string host;
  int port = 1883;
  std::string client_id;      // of two clients with the same one the broker throws out the first
  bool keep_session = false;  // the broker keeps messages for this client while it is away; 3.1.1 only
  std::string ca_file;        // PEM; empty = no TLS
  std::string certificate_file;
  std::string key_file;
  std::string user;  // empty = none
  std::string password;
  int keep_alive_s = 10;        // a silent broker is given up after twice as long at most
  double longest_retry_s = 10;  // attempts begin 0.1 s apart, each pause is twice the one before, until one lasts
  std::string subscribe_to;     // topic filter, QoS 1; empty = none; refused, it breaks the connection
  /// A connection that stood so long has lasted, and one over which all that was published is confirmed. Longer than
  /// the usual pause between two clients that throw each other out under one id.
  std::chrono::seconds lasting{15};
};

enum class MqttVersion : uint8_t { v3_1_1 = 4, v5 = 5 };

/// What follows a message that was received.
enum class MqttNext : uint8_t {
  go_on,
  enough,     // it is confirmed, as far as there is room to send that, and none behind it: the client ends
  not_taken,  // nor is it: a broker that keeps the session delivers it again
};

struct MqttConnection {
  MqttVersion version = MqttVersion::v5;
  int number = 0;
  std::string doubt;  // the ones before it ended soon, and nothing was confirmed over them; empty = not so
};

struct MqttRefusal {
  std::string why;
  bool not_authorised = false;  // who writes is not allowed to, whatever it is
};

/// Called in the client's own thread.
struct MqttEvents {
  std::function<void(const MqttConnection&)> connected;      // and subscribed, if there is a filter
  std::function<void(const std::string& why)> disconnected;  // also after every attempt that failed
  std::function<void(int id)> delivered;                     // the broker has it
  /// The broker has it not, and does not want it. Version 3.1.1 has no words for that: there it is `delivered`.
  std::function<void(int id, const MqttRefusal& refusal)> refused;
  std::function<void(std::span<const uint8_t> payload)> received;
  /// Nobody has subscribed there, so the broker keeps it for nobody. Version 3.1.1 says `delivered`.
  std::function<void(int id)> unheard = {};
  /// Asked behind every `received`. Where the client ends by it `disconnected` is the last event.
  std::function<MqttNext()> next = {};
  /// A connection that was in doubt has lasted.
  std::function<void()> lasts = {};
};

class MqttClient {
 public:
  /// Begins to connect. Throws BadInput when the certificate files cannot be used, or not without another one.
  MqttClient(const MqttOptions& options, MqttEvents events);
  /// Says good-bye to the broker; what it has not confirmed is not delivered.
  ~MqttClient();
  MqttClient(const MqttClient&) = delete;
  MqttClient& operator=(const MqttClient&) = delete;

  /// QoS 1; gives the id that `delivered`, `refused` or `unheard` will have, unless `disconnected` comes first: then
  /// the broker may have the message or not, and who published it publishes it again. An error: it was not taken. From
  /// any thread. Over the connection with that number and no later one, so that nothing overtakes what was under way
  /// over it when it broke; nothing = over any.
  core::Result<int> publish(const std::string& topic, std::span<const uint8_t> payload,
                            std::optional<int> connection = std::nullopt);
  /// Ends the connection with that number, if it still stands, and makes another one; `disconnected` gets the reason.
  void give_up(int connection, const std::string& why);

 private:
  class Connection;
  std::unique_ptr<Connection> connection_;
};

/// Whether authority, certificate and key go together: without the authority there is no TLS, whatever else is named.
core::Status check_tls(const MqttOptions& options);
/// Whether a broker lets anybody write there: one topic, not a filter of topics.
core::Status check_topic(const std::string& topic);
/// One sentence when whoever is on the way reads the password; otherwise empty.
std::string plain_password(const MqttOptions& options);
/// "HOST" or "HOST:PORT" into the options; an IPv6 address before a port stands in brackets.
core::Status parse_broker(const std::string& text, MqttOptions& options);
/// As parse_broker() reads it, with the port.
std::string broker_of(const MqttOptions& options);
/// First line of a file that holds a password.
core::Result<std::string> read_password(const std::string& file);

}  // namespace railfix::ground_link
