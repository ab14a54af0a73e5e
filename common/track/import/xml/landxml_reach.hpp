// Profiles and cant of LandXML that end before their alignment does.
#pragma once

#include <vector>

#include "track/alignment.hpp"

namespace railfix::track {

constexpr double kToldOutsideM = 1.0;

/// Goes on level from a profile's first and last point to the ends of its alignment, as a guess, where they are farther
/// than kToldOutsideM. Returns whether it did.
bool level_to_ends(std::vector<GradePoint>& profile, double length_m);

/// Does the last cant hold up to the end though the curve that it is for does not? On one and the same arc it may.
bool runs_on(const std::vector<CantPoint>& cant, const std::vector<Element>& elements);

}  // namespace railfix::track
