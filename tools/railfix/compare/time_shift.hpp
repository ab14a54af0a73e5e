// Clocks that differ show in the errors of a train that runs now fast, now slowly.
#pragma once

#include "compare/pairing.hpp"

namespace railfix::compare {

/// How far a report lies behind where it should be.
struct Lag {
  size_t leg = 0;
  double speed_mps = 0;  // its size; a report without it is left out
  double behind_m = 0;   // in running direction; NaN is left out
};

/// Least squares of the lags over the speed: a system whose stamps are late lies behind by speed times delay.
struct TimeShift {
  double shift_s = 0;  // NaN with fewer than 3 lags or one speed only
  double sigma_s = 0;  // errors of one leg may be all alike
  double way_m = 0;    // what the shift comes to at these speeds, root mean square
};
TimeShift time_shift(const std::vector<Lag>& lags);

/// Of the certified system's stamps against ours.
TimeShift time_shift(const std::vector<Pair>& pairs);

}  // namespace railfix::compare
