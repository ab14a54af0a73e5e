// A real Mosquitto for tests: on a free port of this machine, its sessions kept over a restart.
#pragma once

#include <optional>

#include "support/loopback.hpp"
#include "support/program.hpp"

namespace railfix::test {

inline constexpr const char* kMosquitto = "/usr/sbin/mosquitto";

class Broker {
 public:
  explicit Broker(std::filesystem::path folder, std::string listener_settings = "", bool anonymous = true)
      : folder_(std::move(folder)), listener_settings_(std::move(listener_settings)), anonymous_(anonymous) {
    std::filesystem::create_directories(folder_);
  }

  /// Runs and accepts connections when it returns. The port stays the same over restarts.
  bool start() {
    for (int attempt = 0; attempt < 10; ++attempt) {
      if (port_ == 0) port_ = free_port();
      std::ofstream(folder_ / "broker.conf") << "listener " << port_ << " 127.0.0.1\n"
                                             << listener_settings_ << "allow_anonymous "
                                             << (anonymous_ ? "true" : "false") << "\nuser root\npersistence true\n"
                                             << "persistence_location " << folder_.string() << "/\n"
                                             << "max_queued_messages 0\nmax_inflight_messages 0\n";
      program_.emplace(std::vector<std::string>{kMosquitto, "-c", (folder_ / "broker.conf").string()},
                       Program::Options{folder_ / "broker.log", {}, {}});
      while (!program_->exit_code()) {
        if (accepts()) return true;
        poll(nullptr, 0, 10);
      }
      if (was_up_) continue;  // the port must stay: it will be free soon
      port_ = 0;              // somebody else was faster
    }
    return false;
  }
  /// Ends it in order: sessions and messages it has taken are kept.
  void stop() {
    was_up_ = true;
    program_->end(SIGTERM);
  }
  /// It does not read what comes, as one that is overloaded, until it goes on.
  void pause() { program_->send(SIGSTOP); }
  void go_on() { program_->send(SIGCONT); }
  /// Reads its files of passwords and rights again.
  void reload() { program_->send(SIGHUP); }
  [[nodiscard]] std::string address() const { return "localhost:" + std::to_string(port_); }
  [[nodiscard]] int port() const { return port_; }

 private:
  [[nodiscard]] bool accepts() const {
    const int socket_number = tcp_socket();
    const bool connected = connect_to_loopback(socket_number, port_);
    close(socket_number);
    return connected;
  }

  std::filesystem::path folder_;
  std::string listener_settings_;
  bool anonymous_;
  int port_ = 0;
  bool was_up_ = false;
  std::optional<Program> program_;
};

}  // namespace railfix::test
