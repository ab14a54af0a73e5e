// TCP on this machine's loopback, for tests that are a server or talk to one.
#pragma once

#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cstdint>

namespace railfix::test {

inline int tcp_socket() {
  return socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
}

inline sockaddr_in loopback(int port) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  address.sin_port = htons(static_cast<uint16_t>(port));
  return address;
}

/// Binds to a port that nobody has and returns it; -1 = none.
inline int bind_to_loopback(int socket_number) {
  auto address = loopback(0);
  socklen_t length = sizeof address;
  const bool bound = bind(socket_number, reinterpret_cast<sockaddr*>(&address), length) == 0 &&
                     getsockname(socket_number, reinterpret_cast<sockaddr*>(&address), &length) == 0;
  return bound ? ntohs(address.sin_port) : -1;
}

inline bool connect_to_loopback(int socket_number, int port) {
  const auto address = loopback(port);
  return connect(socket_number, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0;
}

/// One that nobody listens on; somebody may, before the caller does.
inline int free_port() {
  const int socket_number = tcp_socket();
  const int port = bind_to_loopback(socket_number);
  close(socket_number);
  return port;
}

}  // namespace railfix::test
