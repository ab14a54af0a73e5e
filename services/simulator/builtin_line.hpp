// The lines that need no file. EPSG:2056, start at "1:100".
#pragma once

#include <string>

#include "core/result.hpp"
#include "track/map.hpp"

namespace railfix::simulator {

/// 4 km with curves, cant, grades, a station loop with two switches, a tunnel, balises, masts and a stretch of double
/// track. Edges main_west (0-1380 m), main_station (460 m), main_east (2160 m), loop, second_east.
track::Map builtin_line();

/// About 30 km: ten open stretches (R 300-2000 m, grades, tunnels, bridges, double and triple track) and ten stations
/// with loops on either side. Edges open_1, station_1, open_2, ..., then loops and second tracks.
track::Map long_line();

/// "default" or "long".
core::Result<track::Map> builtin_line(const std::string& name);

}  // namespace railfix::simulator
