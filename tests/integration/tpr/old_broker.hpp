// A broker that knows only MQTT 3.1.1: a door before a real one that turns away who speaks another version, in the
// words of the standard (3.1.1, 3.2.2.3: CONNACK with return code 1, then the connection ends).
#pragma once

#include <poll.h>

#include <array>
#include <atomic>
#include <string>
#include <thread>

#include "support/loopback.hpp"

namespace railfix::test {

class OldBroker {
 public:
  explicit OldBroker(int broker_port) : broker_port_(broker_port), door_(tcp_socket()), port_(bind_to_loopback(door_)) {
    listen(door_, 4);
    thread_ = std::thread([this] { serve(); });
  }
  ~OldBroker() {
    ending_ = true;
    thread_.join();
    close(door_);
  }
  OldBroker(const OldBroker&) = delete;
  OldBroker& operator=(const OldBroker&) = delete;
  [[nodiscard]] std::string address() const { return "localhost:" + std::to_string(port_); }
  /// Connections that were turned away.
  [[nodiscard]] int refused() const { return refused_; }

 private:
  static constexpr int kTurnMs = 20;
  static constexpr size_t kVersionAt = 8;  // of CONNECT, behind "MQTT"; its length takes one byte here
  static constexpr uint8_t kVersion311 = 4;

  static bool readable(int from) {
    pollfd one{from, POLLIN, 0};
    return poll(&one, 1, kTurnMs) > 0;
  }
  void serve() {
    while (!ending_) {
      if (!readable(door_)) continue;
      const int client = accept(door_, nullptr, nullptr);
      std::array<uint8_t, kVersionAt + 1> begin{};
      if (recv(client, begin.data(), begin.size(), MSG_PEEK | MSG_WAITALL) == static_cast<ssize_t>(begin.size())) {
        if (begin[kVersionAt] == kVersion311) {
          let_in(client);
        } else {
          turn_away(client);
        }
      }
      close(client);
    }
  }
  void turn_away(int client) {
    constexpr std::array<uint8_t, 4> kConnack{0x20, 2, 0, 1};
    std::array<uint8_t, 1024> rest{};
    (void)recv(client, rest.data(), rest.size(), 0);  // unread, it would make the end of the connection a reset
    (void)send(client, kConnack.data(), kConnack.size(), MSG_NOSIGNAL);
    ++refused_;
  }
  void let_in(int client) {
    const int broker = tcp_socket();
    bool goes = connect_to_loopback(broker, broker_port_);
    while (goes && !ending_) {
      std::array<pollfd, 2> ends{{{client, POLLIN, 0}, {broker, POLLIN, 0}}};
      if (poll(ends.data(), ends.size(), kTurnMs) <= 0) continue;
      for (size_t i = 0; i < 2 && goes; ++i) {
        if (ends[i].revents != 0) goes = pass_on(ends[i].fd, ends[1 - i].fd);
      }
    }
    close(broker);
  }
  static bool pass_on(int from, int to) {
    std::array<uint8_t, 4096> bytes{};
    const auto count = recv(from, bytes.data(), bytes.size(), 0);
    return count > 0 && send(to, bytes.data(), static_cast<size_t>(count), MSG_NOSIGNAL) == count;
  }

  int broker_port_;
  int door_;
  int port_;
  std::atomic<int> refused_ = 0;
  std::atomic<bool> ending_ = false;
  std::thread thread_;
};

}  // namespace railfix::test
