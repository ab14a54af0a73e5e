// Do samples come when they should? One that comes out of rhythm may have another clock behind it, and where none comes
// at all the clock may have been set forward.
#pragma once

#include <algorithm>
#include <cstdint>

namespace railfix::fusion {

/// Usual time between the samples of one odometer. A plain value.
class Rhythm {
 public:
  /// A sample came so long after the one before: so much too early or too late; 0 = in rhythm.
  double add(double dt_s);
  /// No sensor had a sample for so long.
  void pause(double gap_s) { pause_s_ = std::max(pause_s_, gap_s); }
  [[nodiscard]] double period_s() const { return period_s_; }

 private:
  double period_s_ = 0;
  int samples_ = 0;
  int off_ = 0;            // samples in a row that came out of it ...
  double off_time_s_ = 0;  // ... and the time that they took
  double pause_s_ = 0;     // the longest without a sample of any sensor since its last one
};

/// Gaps in all data. What counts way over one tells whether the time has gone by. A plain value.
class DataGap {
 public:
  /// A sample of any sensor, behind the one before it, of a train that runs at that speed.
  void add(int64_t before_ns, int64_t stamp_ns, double speed_mps);
  /// Some odometer has counted since then: over the gap, or not.
  void counted_since(int64_t since_ns) {
    if (since_ns <= begin_ns_) way_m_ = 0;
  }
  /// So far behind the train is where no time has gone by.
  [[nodiscard]] double way_m() const { return way_m_; }
  void hold(double way_m) { way_m_ = std::max(way_m_, way_m); }
  void settle() { way_m_ = 0; }
  [[nodiscard]] int64_t begin_ns() const { return begin_ns_; }
  void set_clock(int64_t stamp_ns) { begin_ns_ = std::min(begin_ns_, stamp_ns); }

 private:
  double period_s_ = 0;  // usual time between samples
  int samples_ = 0;
  int64_t begin_ns_ = 0;  // of the gaps whose way is in doubt, or was last
  double way_m_ = 0;
};

}  // namespace railfix::fusion
