// What a comparison comes to, as text: the GAMAB verdicts over legs.
#pragma once

#include <string>
#include <vector>

#include "compare/columns.hpp"
#include "compare/doubts.hpp"
#include "compare/gamab.hpp"

namespace railfix::compare {

/// Of one side, without signs.
std::vector<double> sizes_of(const std::vector<Sample>& samples, double Sample::*side);

/// "-" where it is not known.
std::string figure(const char* format, double value);

/// Prints every ratio, its bounds and the verdict. A comparison with doubts is never "at least as good".
Verdict print_verdict(const Columns& columns, const Doubts& doubts, const Demand& demand);

}  // namespace railfix::compare
