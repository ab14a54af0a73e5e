// Position with the references of a real line, at the level of measurements.
#pragma once

#include <cstdint>
#include <string>

namespace railfix::train {

/// Runs the simulator's long line (26 km, frogs of ten stations, tunnel portals) `runs` times for each set of sensors
/// and prints a table, or the row `only`. Camera and sightings are as good as they were measured on drawn pictures.
void print_positions(uint64_t seed, int runs, const std::string& only = "");

}  // namespace railfix::train
