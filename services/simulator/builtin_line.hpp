// The line that needs no file: 4 km with curves, cant, grades, a station loop with two switches, a tunnel, balises,
// masts.
#pragma once

#include "track/map.hpp"

namespace railfix::simulator {

/// EPSG:2056. Edges main_west (0-1380 m), main_station (460 m), main_east (2160 m), and the station's loop; start at
/// "1:100".
track::Map builtin_line();

}  // namespace railfix::simulator
