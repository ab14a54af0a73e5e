// Position with the references of a real line, at the level of measurements.
#pragma once

#include <cstdint>

namespace railfix::train {

/// Runs the simulator's long line (26 km, frogs of ten stations, tunnel portals) `runs` times for each set of sensors
/// and prints a table. Camera and sightings are as good as they were measured on drawn pictures.
void print_positions(uint64_t seed, int runs);

}  // namespace railfix::train
