// What forbids "at least as good" whatever the ratios say: sides that contradict each other or were not seen alike.
#pragma once

#include "compare/columns.hpp"
#include "compare/time_shift.hpp"

namespace railfix::compare {

struct StampsOff {
  double shift_s = 0;   // positive: the certified system's are late
  double offset_s = 0;  // that puts them right
  bool by_truth = false;
};

struct Doubts {
  // Legs on which both cannot be right.
  size_t apart = 0;  // their intervals have nothing in common, and no truth says who is wrong
  // More than a chance report: two of the leg or half of it, or of all pairs more than 1 in 100.
  size_t turned = 0;                // the train looks the one way in ours and the other way in theirs
  size_t runs_apart = 0;            // the same of the way that it runs
  size_t speeds_apart = 0;          // V_TRAIN
  std::optional<StampsOff> stamps;  // by more than chance, and so much that it matters
  size_t off_line = 0;              // ours refers to a group that is not on the line, and the certified system is on it
  size_t other_groups = 0;          // ours refers to a group from which nothing leads to the certified one
  // Certified reports.
  size_t silent = 0;   // ours, known a moment ago, cannot be carried to them (Beside::silent)
  size_t heard = 0;    // ... and all at which ours was known a moment ago
  size_t outside = 0;  // from before our log begins or after it ends
  size_t in_all = 0;
  double ours_every_s = 0;  // Counted::every_s
  double certified_every_s = 0;
  /// What ours said last is held against a fresh certified report; sent behind each group only, it is always good. The
  /// other way round nothing is gained: at the time of a certified report, ours of a moment ago is compared.
  [[nodiscard]] bool ours_seldom() const;
  /// Left out where it is silent: what is compared is what ours chose to say.
  [[nodiscard]] bool ours_silent() const;
  /// The logs are of other times.
  [[nodiscard]] bool other_times() const;
};

/// `offset_s` is in the certified stamps already. The truth judges the pairs it covers and the certified stamps;
/// without it the sides must agree.
Doubts doubts_of(const Pairing& pairing, const std::optional<Judge>& judge, double offset_s);

/// Of the certified system's stamps against the truth.
TimeShift shift_to_truth(const std::vector<Pair>& pairs, const Judge& judge);

}  // namespace railfix::compare
