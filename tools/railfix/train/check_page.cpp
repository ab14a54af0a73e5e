// The monitor's page on this computer.
#include <arpa/inet.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>

#include "train/findings.hpp"
#include "train/roll_out.hpp"
#include "train/setting_files.hpp"

namespace railfix::tool {
namespace {

constexpr int64_t kUsualPort = 8080;

struct Socket {
  sockaddr_storage address{};
  socklen_t bytes = 0;  // 0 = the text is no IP address
};

Socket socket_of(const std::string& text, int64_t port) {
  Socket socket;
  auto* four = reinterpret_cast<sockaddr_in*>(&socket.address);
  auto* six = reinterpret_cast<sockaddr_in6*>(&socket.address);
  if (inet_pton(AF_INET, text.c_str(), &four->sin_addr) == 1) {
    four->sin_family = AF_INET;
    four->sin_port = htons(static_cast<uint16_t>(port));
    socket.bytes = sizeof(*four);
  } else if (inet_pton(AF_INET6, text.c_str(), &six->sin6_addr) == 1) {
    six->sin6_family = AF_INET6;
    six->sin6_port = htons(static_cast<uint16_t>(port));
    socket.bytes = sizeof(*six);
  }
  return socket;
}

/// What the monitor will do: 0, or why it cannot listen there.
int why_not_bound(const Socket& at) {
  const int tried = socket(at.address.ss_family, SOCK_STREAM | SOCK_CLOEXEC, 0);
  if (tried < 0) return errno;
  const int yes = 1;
  setsockopt(tried, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof(yes));
  const int failed = bind(tried, reinterpret_cast<const sockaddr*>(&at.address), at.bytes) == 0 ? 0 : errno;
  close(tried);
  return failed;
}

/// The monitor that runs here has it; one that does not say where its page is may.
bool is_our_own(const HostFolder& folder, int64_t port) {
  const auto plan = folder.plan();
  if (!plan || plan->down || plan->service("monitor") == nullptr) return false;
  const auto health = health_of(*plan, folder.state(), "monitor");
  return health.healthy && (health.serves.empty() || health.serves.ends_with(":" + std::to_string(port) + "/"));
}

}  // namespace

std::vector<Finding> check_page(const Manifest& manifest, const TrainHost& host, const std::filesystem::path& root) {
  Findings findings;
  const auto* monitor = manifest.service("monitor");
  if (monitor == nullptr || monitor->host != host.name) return findings;
  const auto of = [&](const char* key) { return setting_of(manifest.settings, "monitor", key); };
  const auto address = of("address").empty() ? host.address : of("address");
  const int64_t port = of("port").empty() ? kUsualPort : std::atoll(of("port").c_str());
  const auto at = socket_of(address, port);
  const std::string remedy = ", and the monitor would not start; leave it out, and the page is on the train network";
  if (at.bytes == 0) {
    error(findings, "settings.monitor.address: " + address + " is no IP address" + remedy);
    return findings;
  }
  const int failed = why_not_bound(at);
  if (failed == EADDRNOTAVAIL && !of("address").empty()) {
    error(findings, "settings.monitor.address: " + address + " is not an address of this computer" + remedy);
  } else if (failed == EADDRINUSE && !is_our_own(HostFolder(root), port)) {
    const bool searches = of("port_search") != "0";
    findings.push_back(
        {!searches,
         "settings.monitor.port: " + std::to_string(port) + " is taken on this computer by another program, and the " +
             (searches ? "page will be at another one (railfix train status says which)" : "monitor would not start") +
             "; end that program, or set another port"});
  }
  return findings;
}

}  // namespace railfix::tool
