// What a comparison comes to, as text: the GAMAB verdicts over legs.
#pragma once

#include <string>
#include <vector>

#include "compare/gamab.hpp"

namespace railfix::compare {

/// What is compared of each pair of reports, ours and the certified one.
struct Columns {
  std::vector<Sample> lengths;
  std::vector<Sample> errors;
  std::vector<Sample> outside;
  std::vector<Sample> available;  // 1 = a report with a known interval
};

/// Legs on which both cannot be right.
struct Contradicted {
  size_t apart = 0;       // their intervals have nothing in common, and no truth says who is wrong
  size_t turned = 0;      // in half of their pairs the train looks the one way in ours and the other way in theirs
  size_t runs_apart = 0;  // the same of the way that it runs
};

/// Of one side, without signs.
std::vector<double> sizes_of(const std::vector<Sample>& samples, double Sample::*side);

/// "-" where it is not known.
std::string figure(const char* format, double value);

/// Prints every ratio, its bounds and the verdict. A comparison with legs that contradict each other is never "at least
/// as good".
Verdict print_verdict(const Columns& columns, const Contradicted& legs, const Demand& demand);

}  // namespace railfix::compare
