// The monitor's page on this computer.
#include <arpa/inet.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>

#include "train/findings.hpp"
#include "train/setting_files.hpp"

namespace railfix::tool {
namespace {

struct Socket {
  sockaddr_storage address{};
  socklen_t bytes = 0;  // 0 = the text is no IP address
};

Socket socket_of(const std::string& text) {
  Socket socket;
  auto* four = reinterpret_cast<sockaddr_in*>(&socket.address);
  auto* six = reinterpret_cast<sockaddr_in6*>(&socket.address);
  if (inet_pton(AF_INET, text.c_str(), &four->sin_addr) == 1) {
    four->sin_family = AF_INET;
    socket.bytes = sizeof(*four);
  } else if (inet_pton(AF_INET6, text.c_str(), &six->sin6_addr) == 1) {
    six->sin6_family = AF_INET6;
    socket.bytes = sizeof(*six);
  }
  return socket;
}

/// What the monitor will do: 0, or why it cannot listen there.
int why_not_bound(const Socket& at) {
  const int tried = socket(at.address.ss_family, SOCK_STREAM | SOCK_CLOEXEC, 0);
  if (tried < 0) return errno;
  const int failed = bind(tried, reinterpret_cast<const sockaddr*>(&at.address), at.bytes) == 0 ? 0 : errno;
  close(tried);
  return failed;
}

}  // namespace

std::vector<Finding> check_page(const Manifest& manifest, const TrainHost& host) {
  Findings findings;
  const auto* monitor = manifest.service("monitor");
  const auto address = setting_of(manifest.settings, "monitor", "address");
  if (monitor == nullptr || monitor->host != host.name || address.empty()) return findings;
  const auto at = socket_of(address);
  const std::string remedy = ", and the monitor would not start; leave it out, and the page is on the train network";
  if (at.bytes == 0) {
    error(findings, "settings.monitor.address: " + address + " is no IP address" + remedy);
  } else if (why_not_bound(at) == EADDRNOTAVAIL) {
    error(findings, "settings.monitor.address: " + address + " is not an address of this computer" + remedy);
  }
  return findings;
}

}  // namespace railfix::tool
