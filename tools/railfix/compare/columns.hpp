// From paired reports to what the verdict is over, leg by leg: availability, lengths, errors and broken promises.
#pragma once

#include <optional>
#include <vector>

#include "compare/gamab.hpp"
#include "compare/pairing.hpp"
#include "evaluation/truth.hpp"

namespace railfix::compare {

/// A report against the truth; both on the path that begins where the truth does.
struct Judge {
  const evaluation::Truth* truth;
  double foot_to_front_m;
  [[nodiscard]] bool covers(const Pair& pair) const;
  /// NaN where the truth says nothing.
  [[nodiscard]] double error_m(const PlacedReport& report) const;
  /// As compare_broken() takes it. An interval with an open end promises too little to count as kept.
  [[nodiscard]] double outside(const PlacedReport& report) const;
  /// It is on another track than the other side, which is on the line before and behind and right there: passed beyond
  /// the switch, the line is the true way. As `railfix evaluate` has it, the wrong group is a broken promise. On a loop
  /// beside the line, which is as long, the distance alone proves nothing.
  [[nodiscard]] bool on_other_track(const OffLine& report) const;
};

/// Of a standstill the first and the last: those between say the same again.
std::vector<Pair> without_repeats(const std::vector<Pair>& pairs);

struct Columns {
  std::vector<Sample> lengths;  // of pairs without repeats, ours as it was sent last
  std::vector<Sample> errors;   // of the same
  std::vector<Sample> outside;  // of all reports with a place: a promise needs no partner
  /// Reports among those that are outside because they name a group of another track.
  size_t ours_other_track = 0;
  size_t certified_other_track = 0;
  std::vector<Sample> available;  // 1 = a report with a known interval; repeats count where one side's changes
};
Columns columns_of(const Pairing& pairing, const std::optional<Judge>& judge);

}  // namespace railfix::compare
