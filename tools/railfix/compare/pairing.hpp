// Two systems' reports at the same times: ours are carried to the time of each certified one by the reported speeds.
#pragma once

#include <functional>
#include <vector>

#include "compare/placed_report.hpp"

namespace railfix::compare {

struct Pair {
  int64_t stamp_ns = 0;  // of the certified report
  size_t leg = 0;        // certified reports in a row with the same LRBG: errors inside a leg belong together
  size_t stay = 0;       // the same for certified reports in a row at standstill in one place; else each its own
  PlacedReport certified;
  PlacedReport ours;           // at stamp_ns
  double carried_m = 0;        // bound of what carrying may add: V_TRAIN is rounded to 5 km/h
  PlacedReport ours_sent;      // the last one before, as it was sent
  double faster_kmh = 0;       // V_TRAIN of ours, carried, less that of the certified report
  double speed_apart_kmh = 0;  // that of the certified report lies so far from what ours said before and behind
  /// Positive: ours lies in front, in the certified report's running direction.
  [[nodiscard]] double difference_m() const;
  /// The two intervals, ours wider by carried_m, have a place in common.
  [[nodiscard]] bool overlap() const;
  /// Both say which way the train looks (Q_DIRLRBG), and not the same.
  [[nodiscard]] bool turned() const;
  /// Both say which way it runs (Q_DIRTRAIN, and V_TRAIN at least 5 km/h), and not the same.
  [[nodiscard]] bool runs_apart() const;
  /// Their speeds differ by more than rounding and, of each, SUBSET-041 allow.
  [[nodiscard]] bool speeds_apart() const;
};

/// Who had a position with a known interval at the time of a certified report. By the messages alone: what is missing
/// on our map says nothing about them.
struct Availability {
  size_t leg = 0;
  size_t stay = 0;
  bool ours = false;  // in the last report, when it is no older than ours are carried
  bool certified = false;
};

struct OnLeg {
  size_t leg = 0;
  PlacedReport report;
};

/// Reports of one side.
struct Counted {
  std::vector<OnLeg> placed;  // paired or not; the leg is that of the certified report at or before it
  size_t off_line = 0;        // with a position, but relative to a group that the line does not have
  /// Length of the gap between reports that a moment lies in, on average over the time that both report. Gaps that
  /// nothing is carried over are left out; NaN when there are no others.
  double every_s = 0;
};

struct Pairing {
  std::vector<Pair> pairs;
  std::vector<Availability> availability;  // of every certified report, those without a place included
  size_t legs = 0;                         // that have pairs
  Counted ours;
  Counted certified;
  size_t alone = 0;  // placed certified reports without one of ours before and behind
};

/// Ours are carried between two reports on the same axis that follow each other and are at most `longest_gap_ns` apart.
/// REQUIRES: both sorted.
Pairing pair_up(const std::vector<TimedReport>& ours, const std::vector<TimedReport>& certified, const Axes& axes,
                int64_t longest_gap_ns);

}  // namespace railfix::compare
