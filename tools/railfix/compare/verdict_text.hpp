// What a comparison comes to, as text: the GAMAB verdicts over legs.
#pragma once

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

/// Of one side, without signs.
std::vector<double> sizes_of(const std::vector<Sample>& samples, double Sample::*side);

/// Prints every ratio, its bounds and the verdict. contradicted_legs: on which the intervals have nothing in common and
/// no truth says who is wrong; such a comparison is never "at least as good".
Verdict print_verdict(const Columns& columns, size_t contradicted_legs, const Demand& demand);

}  // namespace railfix::compare
