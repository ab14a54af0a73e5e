// Whether the other hosts' clocks agree with this one's: stamps of two hosts can only be compared when they do. Knows
// no DDS and no clock.
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <string>

namespace railfix::service {

class ClockWatch {
 public:
  /// More than a network of a train delays a message; at 30 m/s it is 3 m.
  static constexpr int64_t kToleratedNs = 100'000'000;
  /// Messages that are compared: the quickest of them tells the clock from a slow way.
  static constexpr size_t kMessages = 20;

  explicit ClockWatch(std::string host) : host_(std::move(host)) {}
  /// A message that `host` has stamped with its wall clock came at `received_ns` of ours.
  void hear(const std::string& host, int64_t stamp_ns, int64_t received_ns);
  /// Empty when all agree, otherwise one sentence: which host, by how much, what to do.
  [[nodiscard]] std::string trouble() const;

 private:
  std::string host_;
  std::map<std::string, std::deque<int64_t>> late_ns_;  // of each other host's last messages
};

}  // namespace railfix::service
