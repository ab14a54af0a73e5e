// When each moment of a recording is due, while it is paused, moved, and played faster or slower. Knows no clock: the
// caller says what time it is (monotonic ns). Times of the recording are its log times.
#pragma once

#include <cstdint>

namespace railfix::tool {

class Timeline {
 public:
  /// Stands at this moment until play().
  Timeline(int64_t at_ns, double rate) : anchor_ns_(at_ns), at_anchor_ns_(at_ns), rate_(rate) {}

  void play(int64_t now_ns);
  void pause(int64_t now_ns);
  void seek(int64_t at_ns, int64_t now_ns);
  /// REQUIRES: rate > 0.
  void set_rate(double rate, int64_t now_ns);

  [[nodiscard]] bool playing() const { return playing_; }
  [[nodiscard]] double rate() const { return rate_; }
  [[nodiscard]] int64_t at_ns(int64_t now_ns) const;
  /// REQUIRES: playing().
  [[nodiscard]] int64_t due_ns(int64_t recorded_ns) const;

 private:
  int64_t anchor_ns_;     // monotonic ...
  int64_t at_anchor_ns_;  // ... when the recording stood here
  double rate_;
  bool playing_ = false;
};

}  // namespace railfix::tool
