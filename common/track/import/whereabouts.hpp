// Whether a map lies where its coordinate system is made for: one whose axes are exchanged is a mirror image.
#pragma once

#include <string>

#include "track/map.hpp"

namespace railfix::track {

/// What is wrong with it and why that may be; empty where it lies within a degree of the system's area, or nobody
/// knows.
std::string whereabouts_problem(const Map& map);

}  // namespace railfix::track
