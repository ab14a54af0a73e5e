// A broker that misbehaves where Mosquitto cannot be made to: MQTT 5, one packet answered after the other, as it is
// told at that moment.
#pragma once

#include <poll.h>

#include <array>
#include <atomic>
#include <map>
#include <mutex>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include "ground_link/ground_report.hpp"
#include "support/loopback.hpp"

namespace railfix::test {

class FalseBroker {
 public:
  struct Came {
    int connection;  // 1, 2, ...
    int64_t stamp_ns;
  };

  FalseBroker() : door_(tcp_socket()), port_(bind_to_loopback(door_)) {
    listen(door_, 16);
    thread_ = std::thread([this] { serve(); });
  }
  ~FalseBroker() {
    ending_ = true;
    thread_.join();
    while (!clients_.empty()) end(clients_.begin()->first);
    close(door_);
  }
  FalseBroker(const FalseBroker&) = delete;
  FalseBroker& operator=(const FalseBroker&) = delete;

  [[nodiscard]] std::string address() const { return "localhost:" + std::to_string(port_); }
  /// Ends the connections that stand.
  void cut() { cut_ = true; }
  [[nodiscard]] int connections() const { return let_in_; }
  /// Of the newest connection: who pings has read that it was let in.
  [[nodiscard]] int pings() const { return pings_; }
  [[nodiscard]] std::vector<Came> came() const {
    const std::lock_guard lock(mutex_);
    return came_;
  }

  std::atomic<bool> lets_in = true;  // or says nothing
  std::atomic<bool> throws_out = false;
  std::atomic<bool> confirms = true;
  std::atomic<uint8_t> confirms_with = 0;  // MQTT 5's reason code

 private:
  static constexpr int kTurnMs = 10;
  enum Kind : uint8_t { kConnect = 1, kPublish = 3, kPing = 12 };
  struct Client {
    int number = 0;
    std::vector<uint8_t> unread;
  };

  void serve() {
    while (!ending_) {
      std::vector<pollfd> ears{{door_, POLLIN, 0}};
      for (const auto& [socket_number, client] : clients_) ears.push_back({socket_number, POLLIN, 0});
      poll(ears.data(), ears.size(), kTurnMs);
      if (cut_.exchange(false)) {
        while (!clients_.empty()) end(clients_.begin()->first);
        continue;
      }
      if (ears[0].revents != 0) clients_[accept(door_, nullptr, nullptr)];
      for (size_t i = 1; i < ears.size(); ++i) {
        if (ears[i].revents != 0 && !hear(ears[i].fd)) end(ears[i].fd);
      }
    }
  }
  void end(int socket_number) {
    close(socket_number);
    clients_.erase(socket_number);
  }
  bool hear(int from) {
    std::array<uint8_t, 4096> bytes{};
    const auto count = recv(from, bytes.data(), bytes.size(), 0);
    if (count <= 0) return false;
    auto& unread = clients_[from].unread;
    unread.insert(unread.end(), bytes.begin(), bytes.begin() + count);
    while (unread.size() >= 2) {
      size_t length = 0;
      size_t at = 1;
      do {
        if (at == unread.size()) return true;
        length |= size_t{unread[at] & 0x7FU} << (7 * (at - 1));
      } while ((unread[at++] & 0x80U) != 0);
      if (unread.size() < at + length) return true;
      const auto begin = unread.begin() + static_cast<std::ptrdiff_t>(at);
      const std::vector<uint8_t> packet(begin, begin + static_cast<std::ptrdiff_t>(length));
      const auto kind = static_cast<uint8_t>(unread[0] >> 4U);
      unread.erase(unread.begin(), begin + static_cast<std::ptrdiff_t>(length));
      if (!answer(from, kind, packet)) return false;
    }
    return true;
  }
  static void say(int to, const std::vector<uint8_t>& bytes) {
    (void)send(to, bytes.data(), bytes.size(), MSG_NOSIGNAL);
  }
  /// False: throws it out.
  bool answer(int to, uint8_t kind, const std::vector<uint8_t>& packet) {
    if (kind == kConnect && lets_in) {
      pings_ = 0;
      clients_[to].number = ++let_in_;
      say(to, {0x20, 3, 0, 0, 0});
      return !throws_out;
    }
    if (kind == kPing) {
      say(to, {0xD0, 0});
      ++pings_;
    }
    if (kind == kPublish) take(to, packet);
    return true;
  }
  void take(int from, const std::vector<uint8_t>& packet) {
    const size_t id_at = 2 + (size_t{packet[0]} << 8U | packet[1]);  // behind the topic
    const size_t report_at = id_at + 3 + packet[id_at + 2];          // behind the properties
    const auto report = ground_link::ground_report_from(std::span(packet).subspan(report_at));
    {
      const std::lock_guard lock(mutex_);
      came_.push_back({clients_[from].number, report.ok() ? report.value().stamp_ns : -1});
    }
    if (confirms) say(from, {0x40, 3, packet[id_at], packet[id_at + 1], confirms_with});
  }

  int door_;
  int port_;
  std::map<int, Client> clients_;  // by socket; the thread's own
  std::atomic<int> let_in_ = 0;
  std::atomic<int> pings_ = 0;
  std::atomic<bool> cut_ = false;
  std::atomic<bool> ending_ = false;
  mutable std::mutex mutex_;
  std::vector<Came> came_;
  std::thread thread_;
};

}  // namespace railfix::test
