// What can be said of a client's options without connecting.
#include <arpa/inet.h>

#include <algorithm>
#include <charconv>
#include <fstream>

#include "ground_link/mqtt_client.hpp"

namespace railfix::ground_link {

namespace {

/// Also with the name of an interface behind it (fe80::1%eth0), but with no port behind that.
bool is_ipv6(const std::string& text) {
  in6_addr address{};
  const size_t end = text.find('%');
  const bool has_port = end != std::string::npos && text.find(':', end) != std::string::npos;
  return !has_port && inet_pton(AF_INET6, text.substr(0, end).c_str(), &address) == 1;
}

}  // namespace

core::Status check_tls(const MqttOptions& options) {
  const bool certificate = !options.certificate_file.empty();
  const bool key = !options.key_file.empty();
  if (options.ca_file.empty() && (certificate || key))
    return core::Error{
        "certificate and key without the broker's authority would go unused, over a link in plain text: "
        "name the authority, too (ca_file, --ca)."};
  if (certificate != key) return core::Error{"certificate and key go together: name both, or none."};
  return {};
}

std::string plain_password(const MqttOptions& options) {
  if (options.password.empty() || !options.ca_file.empty()) return "";
  return "the password goes in plain text to " + broker_of(options) +
         "; name the broker's authority (ca_file, --ca), and its port for TLS (8883)";
}

std::string broker_of(const MqttOptions& options) {
  const bool bracketed = options.host.find(':') != std::string::npos;
  return (bracketed ? "[" + options.host + "]" : options.host) + ":" + std::to_string(options.port);
}

core::Status parse_broker(const std::string& text, MqttOptions& options) {
  const auto refused = [&](const std::string& why) {
    return core::Error{"Broker \"" + text + "\": " + why + ", e.g. localhost:1883."};
  };
  if (text.find("://") != std::string::npos)
    return refused("give HOST or HOST:PORT and nothing before it; a certificate authority makes it TLS");
  const bool bracketed = text.starts_with('[');
  const size_t end_of_host = bracketed ? text.find(']') : is_ipv6(text) ? text.size() : text.find(':');
  options.host = bracketed ? text.substr(1, end_of_host - 1) : text.substr(0, end_of_host);
  if (bracketed && (end_of_host == std::string::npos || !is_ipv6(options.host)))
    return refused("in brackets an IPv6 address is wanted, as [::1]:1883, or give HOST or HOST:PORT");
  const std::string behind = text.substr(std::min(text.size(), bracketed ? end_of_host + 1 : end_of_host));
  if (!behind.empty()) {
    const char* end = behind.data() + behind.size();
    const auto parsed = std::from_chars(behind.data() + 1, end, options.port);
    if (behind[0] != ':' || parsed.ec != std::errc() || parsed.ptr != end || options.port < 1 || options.port > 65535)
      return refused("give HOST or HOST:PORT, an IPv6 address before a port in brackets");
  }
  if (options.host.empty()) return refused("the host is missing");
  return {};
}

core::Result<std::string> read_password(const std::string& file) {
  std::ifstream stream(file);
  std::string password;
  if (!stream || !std::getline(stream, password) || password.empty())
    return core::Error{file + ": no password can be read; put it into the first line."};
  return password;
}

}  // namespace railfix::ground_link
