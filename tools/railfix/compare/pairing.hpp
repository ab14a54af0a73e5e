// Two systems' reports at the same times: ours are carried to the time of each certified one by the reported speeds.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
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

/// With a position, but relative to a group that the line does not have.
struct OffLine {
  size_t leg = 0;
  int64_t stamp_ns = 0;
  bool beside_line = false;  // the other side is on the line before and behind, and names no such group there
  /// The other side at this time, where it is on the line before and behind and its group and this one are not of one
  /// ride: so far as the two were passed apart, the map has no way from the one to the other. One side is wrong.
  std::optional<PlacedReport> contradicted_by;
};

/// What ours is at the time of a certified report with a position.
enum class Beside : uint8_t {
  paired,
  unknown,      // no position, or none lately: that is a matter of Availability
  silent,       // a position, but the next one comes too late to carry it, or is unknown: nothing to compare with. Or a
                // side came to its group by a way that is not on the line (NID_PRVLRBG): nobody knows what is nominal
  off_line,     // the last or the next counts from a group that is not on the line, and the certified one is on it
  other_group,  // a position that cannot be compared
  passing,      // the two change to the next group one report apart, or name the same group, which the map lacks
};
struct BesideCertified {
  size_t leg = 0;
  Beside ours = Beside::unknown;
};

/// Reports of one side.
struct Counted {
  std::vector<OnLeg> placed;  // paired or not; the leg is that of the certified report at or before it
  std::vector<OffLine> off_line;
  /// Length of the gap between reports that a moment lies in, on average over the time that the certified system
  /// reports and both logs have; NaN when there is none. It reports where its gaps can be carried over: a night between
  /// two rides counts for nobody, and a silence of ours in a ride counts whole.
  double every_s = 0;
};

struct Pairing {
  std::vector<Pair> pairs;
  std::vector<Availability> availability;  // of every certified report in our log, those without a place included
  std::vector<BesideCertified> beside;     // of every one of them with a position, on the line or not
  size_t legs = 0;                         // that have pairs
  Counted ours;
  Counted certified;
  size_t alone = 0;         // placed certified reports in our log without one of ours before and behind
  size_t outside_ours = 0;  // certified reports from before our log begins or after it ends, by more than a gap
};

/// Ours are carried between two reports on the same axis that follow each other and are at most `longest_gap_ns` apart.
/// `ours_until_ns`: until then ours was listened to, if later than its last report; else its log ends with that.
/// REQUIRES: both sorted.
Pairing pair_up(const std::vector<TimedReport>& ours, const std::vector<TimedReport>& certified, const Axes& axes,
                int64_t longest_gap_ns, std::optional<int64_t> ours_until_ns = std::nullopt);

}  // namespace railfix::compare
