// When recorded pictures are due, and when to begin. Knows no clock: the caller says what time it is.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "messaging/connected.hpp"

namespace railfix::frame_grabber {

/// Recorded rate on the clock of the player, which goes on evenly when the wall clock is set (Player::now_ns()): the
/// first picture is due when it comes (unless it is said when), each other as much later as it was recorded later.
class RealPace {
 public:
  struct Verdict {
    int64_t due_ns = 0;  // on that clock; in the past = now
    bool skip = false;   // more than three periods late
  };
  RealPace() = default;
  /// Due time minus stamp is known before the first picture comes.
  explicit RealPace(std::optional<int64_t> due_minus_stamp_ns)
      : due_minus_stamp_ns_(due_minus_stamp_ns.value_or(0)), begun_(due_minus_stamp_ns.has_value()) {}
  /// REQUIRES: in the order of playing. A picture that is stamped before one already played is due at once.
  Verdict ask(int64_t stamp_ns, int64_t now_ns);
  /// Due time minus stamp of every picture. REQUIRES: asked once.
  [[nodiscard]] int64_t due_minus_stamp_ns() const { return due_minus_stamp_ns_; }

 private:
  int64_t due_minus_stamp_ns_ = 0;
  bool begun_ = false;
  std::optional<int64_t> newest_ns_;
};

/// Lock step: in every step each service has its turn, one after the other.
class LockStep {
 public:
  explicit LockStep(std::vector<std::string> services) : services_(std::move(services)), next_(services_.size()) {}
  /// A new step; the first service has the turn.
  void begin();
  /// No turn is left in this step.
  [[nodiscard]] bool done() const { return next_ == services_.size(); }
  /// Whose turn it is. REQUIRES: not done().
  [[nodiscard]] const std::string& turn() const { return services_[next_]; }
  /// Number of the present step, from 1.
  [[nodiscard]] uint64_t step() const { return step_; }
  /// A service has taken its turn. False when it is not the one that has it: an answer to an older step, or a stranger.
  bool answered(const std::string& service, uint64_t step);

 private:
  std::vector<std::string> services_;
  size_t next_;
  uint64_t step_ = 0;
};

/// Have all found each other, so that no sample of the first picture is lost? Counted as `railfix run` does it.
class Gathering {
 public:
  /// What a service says of itself in service_status.
  struct Told {
    uint32_t endpoints = 0;
    uint32_t matches = 0;
    bool operator==(const Told&) const = default;
  };
  explicit Gathering(std::vector<std::string> services) : services_(std::move(services)) {}
  /// Status of another service that is set up.
  void heard(const std::string& service, const Told& told) { heard_[service] = told; }
  /// REQUIRES: asked ten times a second. Programs without a status (tools) cannot be counted: then it is enough that
  /// nothing has changed for two seconds.
  bool complete(const messaging::Connections& here);

 private:
  static constexpr int kSteadyLooks = 20;
  std::vector<std::string> services_;
  std::map<std::string, Told> heard_;
  std::map<std::string, Told> heard_before_;
  messaging::Connections before_;
  int steady_looks_ = 0;
};

}  // namespace railfix::frame_grabber
