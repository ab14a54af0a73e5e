// A made-up railway network: lines between junctions on a jittered grid, as a country has them. For tests and
// benchmarks of everything that must work on a map of any size; the same options give the same map.
#pragma once

#include <cstdint>

#include "track/map.hpp"

namespace railfix::track {

struct MadeNetworkOptions {
  double track_km = 20000;  // of all tracks together, reached within a few per cent; 20 or more
  uint64_t seed = 1;
  double mast_spacing_m = 0;  // 0 = no masts
};

/// Lines of plain, hills and mountains (R 250-4000 m with clothoids, cant, grades), half of them of two tracks; a
/// station every few kilometres with loops, crossovers and platforms; junctions where lines branch off; tunnels,
/// bridges; a group of two balises about every 1.4 km of main track; frogs. True to scale, with local coordinates in
/// EPSG:32632 (so that it has latitudes and longitudes).
/// Tracks are called L<line> (main), L<line>b (second), S<station>... and J<junction>.
Map made_network(const MadeNetworkOptions& options);

}  // namespace railfix::track
