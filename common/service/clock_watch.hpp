// Whether the other hosts' clocks agree with this one's: stamps of two hosts can only be compared when they do. Of two
// that do not, the one that was set is doubted. Knows no DDS and no clock.
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <string>

namespace railfix::service {

class ClockWatch {
 public:
  /// More than a network of a train delays a message; at 30 m/s it is 3 m.
  static constexpr int64_t kToleratedNs = 100'000'000;
  /// A host that is silent for so long is gone, as a coach that was uncoupled.
  static constexpr int64_t kGoneNs = 10'000'000'000;
  /// Messages that are compared: the quickest of them tells the clock from a slow way.
  static constexpr size_t kMessages = 20;

  explicit ClockWatch(std::string host) : host_(std::move(host)) {}
  /// What this host's clock says, beside one that never jumps. To be called right before hear(), and often.
  void look(int64_t wall_ns, int64_t monotonic_ns);
  /// A message that `host` has stamped with its wall clock came at `received_ns` of ours.
  void hear(const std::string& host, int64_t stamp_ns, int64_t received_ns);
  /// What the kernel says of this host's clock: how far off it can be at most, by whom it is kept (PTP, NTP); nothing
  /// when nobody keeps it.
  void kept(std::optional<int64_t> max_error_ns);
  /// Empty when all agree, otherwise one sentence: which host, by how much, what to do.
  [[nodiscard]] std::string trouble() const;
  /// This host's clock was set, and no other one's has agreed with it since.
  [[nodiscard]] bool own_is_doubted() const { return set_by_ns_ != 0; }

 private:
  std::string host_;
  [[nodiscard]] static std::optional<int64_t> quickest_ns(const std::deque<int64_t>& late_ns);
  struct Heard {
    std::deque<int64_t> late_ns;  // its last messages
    int64_t last_ns = 0;          // our wall clock
  };
  std::map<std::string, Heard> heard_;  // of each other host
  std::optional<int64_t> ahead_ns_;     // of the clock that never jumps
  bool was_kept_ = false;
  bool is_kept_ = false;
  int64_t set_by_ns_ = 0;  // 0 = it was not, or has agreed with another one since
  int64_t set_at_ns_ = INT64_MIN;
  int64_t looked_ns_ = INT64_MAX;
};

}  // namespace railfix::service
