// Landmarks that the runs see elsewhere than the map has them: moved, or wrongly on the map.
#pragma once

#include <memory>
#include <vector>

#include "map/survey_solver.hpp"

namespace railfix::tool {

inline constexpr double kApartSigmas = 3;

/// Solves, and again without what the map says of the things that the runs see beyond kApartSigmas from there: one
/// landmark that has moved pulls neither the runs nor other landmarks. Marks those things.
std::unique_ptr<const SurveySolver> solve_without_moved(const std::vector<SurveySighting>& all,
                                                        std::vector<Thing>& things, const SurveyOptions& options);

}  // namespace railfix::tool
