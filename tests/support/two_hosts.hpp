// Two computers of a train in one: two network namespaces with a cable between them. Needs root.
#pragma once

#include <fcntl.h>
#include <poll.h>
#include <sched.h>
#include <unistd.h>

#include <cstdlib>
#include <fstream>
#include <optional>
#include <sstream>
#include <string>
#include <utility>

#include "messaging/network.hpp"
#include "support/network.hpp"

namespace railfix::test {

class TwoHosts {
 public:
  enum Host { cab, coach };
  static constexpr const char* kAddress[] = {"10.42.1.11", "10.42.1.12"};
  static constexpr const char* kInterface[] = {"train0", "train1"};

  /// What a participant on that host joins this train with.
  static messaging::ParticipantOptions network(Host host, const std::string& train, int64_t domain) {
    auto options = test::network(train, domain);
    options.interfaces = {kInterface[host]};
    options.peers = {kAddress[host == cab ? coach : cab]};
    return options;
  }

  TwoHosts() : home_(opened()) {
    for (int& host : hosts_) {
      if (home_ < 0 || unshare(CLONE_NEWNET) != 0) return;
      host = opened();
    }
    setns(home_, CLONE_NEWNET);
    ready_ = on(cab,
                [&] {
                  return run("ip link set lo up && ip link add train0 type veth peer name train1 netns /proc/" +
                             std::to_string(getpid()) + "/fd/" + std::to_string(hosts_[coach]) +
                             " && ip address add 10.42.1.11/24 dev train0 && ip link set train0 up");
                }) &&
             on(coach,
                [&] {
                  return run("ip link set lo up && ip address add 10.42.1.12/24 dev train1 && ip link set train1 up");
                }) &&
             plugged(true);
  }
  ~TwoHosts() {
    if (home_ >= 0) setns(home_, CLONE_NEWNET);
    for (const int file : {hosts_[cab], hosts_[coach], home_}) {
      if (file >= 0) close(file);
    }
  }
  TwoHosts(const TwoHosts&) = delete;
  TwoHosts& operator=(const TwoHosts&) = delete;

  /// False without the right to make namespaces, or without the program `ip`.
  [[nodiscard]] bool ready() const { return ready_; }

  /// What `work` starts lives on that host: processes, threads and sockets.
  template <class Work>
  auto on(Host host, Work work) -> decltype(work()) {
    struct Home {
      int file;
      ~Home() { setns(file, CLONE_NEWNET); }
    } home{home_};
    setns(hosts_[host], CLONE_NEWNET);
    return work();
  }

  void plug(bool in) {
    on(cab, [&] { return run(std::string("ip link set train0 ") + (in ? "up" : "down")); });
    plugged(in);
  }

  /// Every tenth packet that comes over the cable is lost, on both sides. False without the program `iptables`.
  bool lose(bool every_tenth) {
    const std::string rule = std::string("iptables ") + (every_tenth ? "-A" : "-D");
    bool done = true;
    for (const Host host : {cab, coach}) {
      done = on(host,
                [&] {
                  return run(rule + " INPUT -i " + kInterface[host] +
                             " -m statistic --mode random --probability 0.1 -j DROP");
                }) &&
             done;
    }
    return done;
  }

  /// Bytes that have gone over the cable, both ways.
  uint64_t bytes_on_cable() {
    return on(cab, [] {
      std::ifstream table("/proc/thread-self/net/dev");
      for (std::string line; std::getline(table, line);) {
        const size_t name = line.find("train0:");
        if (name == std::string::npos) continue;
        std::istringstream numbers(line.substr(name + 7));
        uint64_t received = 0;
        uint64_t sent = 0;
        uint64_t skipped = 0;
        numbers >> received;
        for (int i = 0; i < 7; ++i) numbers >> skipped;
        numbers >> sent;
        return received + sent;
      }
      return uint64_t{0};
    });
  }

 private:
  // The carrier comes some milliseconds after the interfaces are up.
  bool plugged(bool in) {
    for (int i = 0; i < 1000; ++i) {
      size_t running = 0;
      for (const Host host : {cab, coach})
        running += on(host, [&] { return messaging::running_interfaces({kInterface[host]}); });
      if (running == (in ? 2U : 0U)) return true;
      poll(nullptr, 0, 10);
    }
    return false;
  }
  static int opened() { return open("/proc/thread-self/ns/net", O_RDONLY | O_CLOEXEC); }
  static bool run(const std::string& commands) { return std::system(commands.c_str()) == 0; }
  int home_;
  int hosts_[2] = {-1, -1};
  bool ready_ = false;
};

}  // namespace railfix::test
