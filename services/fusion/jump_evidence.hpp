// How much landmarks must say together before the train is believed to have been carried where its odometers had not.
// Weights of evidence: natural logarithms of odds, which add up (Good 1985).
#pragma once

#include <algorithm>
#include <cmath>

namespace railfix::fusion {

/// A jump of fewer standard deviations is no wonder.
inline constexpr double kUnlikelySigmas = 2.5;

/// What settles the matter where a sensor that nothing has accused would explain the jump: it is as unlikely to be
/// wrong as the first of the landmarks, and odds of 100 are left to them.
inline constexpr double kExcusedEvidence = 4.6;

/// Against a place, of so many landmarks in a row that say another one. A wrong one is rarely wrong alone: a mount that
/// was knocked, signs that were moved, and whoever names landmarks by those before them.
inline double landmark_evidence(int landmarks) {
  constexpr double kWrongAlike = 0.3;  // probability that the next one is wrong likewise
  return -std::log(kWrongAlike) * landmarks;
}

/// Against a place that is so many of the odometers' standard deviations from where landmarks say, and that so many had
/// confirmed before: what settles the matter. Little speaks for a place that was only told: three landmarks outvote it.
inline double evidence_to_settle(double sigmas, int confirmed_by) {
  constexpr double kTold = 3.0;          // two false ones in a row agree by chance
  constexpr double kMostEvidence = 9.2;  // both odometers are wrong as well, unseen: 1e-4
  constexpr double kSettled = 4.6;       // remaining odds: 0.01
  if (confirmed_by == 0) return kTold;
  return std::min({0.5 * sigmas * sigmas, kMostEvidence, landmark_evidence(confirmed_by)}) + kSettled;
}

}  // namespace railfix::fusion
