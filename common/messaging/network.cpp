#include "messaging/network.hpp"

#include <arpa/inet.h>
#include <ifaddrs.h>
#include <net/if.h>
#include <netinet/in.h>
#include <sys/stat.h>

#include <algorithm>
#include <cstdio>
#include <fstream>

#include "core/fnv.hpp"
#include "core/joined.hpp"

namespace railfix::messaging {
namespace {

constexpr const char* kLoopback = "127.0.0.1";

struct Interface {
  std::string name;
  std::string address;
  bool running = false;
};

std::vector<Interface> interfaces_here() {
  ifaddrs* first = nullptr;
  if (getifaddrs(&first) != 0) return {};
  std::vector<Interface> found;
  for (const ifaddrs* one = first; one != nullptr; one = one->ifa_next) {
    if (one->ifa_addr == nullptr || one->ifa_addr->sa_family != AF_INET) continue;
    char text[INET_ADDRSTRLEN] = {};
    inet_ntop(AF_INET, &reinterpret_cast<const sockaddr_in*>(one->ifa_addr)->sin_addr, text, sizeof(text));
    found.push_back({one->ifa_name, text, (one->ifa_flags & IFF_RUNNING) != 0});
  }
  freeifaddrs(first);
  return found;
}

}  // namespace

core::Result<std::vector<std::string>> addresses_of(const std::vector<std::string>& interfaces) {
  std::vector<std::string> addresses;
  if (interfaces.empty()) return addresses;
  const auto here = interfaces_here();
  for (const auto& wanted : interfaces) {
    const size_t before = addresses.size();
    for (const auto& one : here) {
      if (one.name == wanted || one.address == wanted) addresses.push_back(one.address);
    }
    if (addresses.size() > before) continue;
    return core::Error{"network interface " + wanted + " is not here or has no IPv4 address; this computer has " +
                       interfaces_told()};
  }
  if (std::find(addresses.begin(), addresses.end(), kLoopback) == addresses.end()) addresses.emplace_back(kLoopback);
  return addresses;
}

std::string interfaces_told() {
  return core::joined(interfaces_here(), [](const auto& one) { return one.name + " (" + one.address + ")"; });
}

size_t running_interfaces(const std::vector<std::string>& interfaces) {
  const auto here = interfaces_here();
  return static_cast<size_t>(std::count_if(interfaces.begin(), interfaces.end(), [&](const std::string& wanted) {
    return std::any_of(here.begin(), here.end(), [&](const Interface& one) {
      return one.running && (one.name == wanted || one.address == wanted);
    });
  }));
}

std::string memory_id() {
  std::string text;
  std::ifstream("/proc/sys/kernel/random/boot_id") >> text;
  struct stat network {};
  if (stat("/proc/thread-self/ns/net", &network) == 0) text += std::to_string(network.st_ino);
  core::Fnv hash;
  hash.add(text);
  return hash.hex();
}

}  // namespace railfix::messaging
