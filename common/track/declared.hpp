// When a train's track counts as known behind switches.
#pragma once

namespace railfix::track {

/// From this probability on a track is declared: fusion, the reports and the evaluations take it for the train's.
inline constexpr double kDeclaredProbability = 0.999;

}  // namespace railfix::track
