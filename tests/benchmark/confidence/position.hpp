// Position with the references of a real line, at the level of measurements.
#pragma once

#include <cstdint>
#include <string>

#include "stanford.hpp"

namespace railfix::train {

struct PositionPlan {
  uint64_t seed = 1;
  int runs = 1;
  std::string only;     // this row alone, empty = all
  double every_m = 0;   // references so far apart instead of the line's own
  bool learnt = false;  // every run begins with the scales that another trip of its train has taught
};

/// Runs the simulator's long line (26 km, frogs of ten stations, tunnel portals) so often for each set of sensors and
/// prints the table of docs/sources.md (Markdown). Camera and sightings are as good as they were measured on drawn
/// pictures. Gives the Stanford diagram of all rows.
StanfordCounts print_positions(const PositionPlan& plan);

}  // namespace railfix::train
