#include "track/import/tracks.hpp"

#include <algorithm>

namespace railfix::track {

void FitFigures::include(const FitFigures& other) {
  elements += other.elements;
  max_end_error_m = std::max(max_end_error_m, other.max_end_error_m);
  max_length_change_m = std::max(max_length_change_m, other.max_length_change_m);
  max_heading_step_rad = std::max(max_heading_step_rad, other.max_heading_step_rad);
  max_gap_m = std::max(max_gap_m, other.max_gap_m);
  max_point_distance_m = std::max(max_point_distance_m, other.max_point_distance_m);
  max_chord_deviation_m = std::max(max_chord_deviation_m, other.max_chord_deviation_m);
}

}  // namespace railfix::track
