// A small network for tests: a main line of two edges through a switch, and a branch drawn towards the switch.
//
//   1 --- edge 1 "main" (1000 m) --- 2 --- edge 2 (800 m, left curve) --- 3
//                                     \___ edge 3 "siding" (500 m), runs from 4 to 2
#pragma once

#include <cmath>

#include "core/units.hpp"
#include "track/map.hpp"

namespace railfix::track {

inline Map small_map() {
  Map map;
  map.name = "small";
  map.crs = "EPSG:2056";
  const PlanPose start{2680000, 1250000, core::kPi / 2};  // eastwards
  const Alignment main =
      Alignment::chained(start, {{1000, 0, 0}}, {{0, 400, 0}, {1000, 410, 0}}, {{0, 0.0}, {1000, 0.1}});
  const PlanPose at_switch = main.at(1000).pose;
  const Alignment on = Alignment::chained(at_switch, {{800, 1.0 / 500, 1.0 / 500}});
  const PlanPose far = advance(at_switch, {500, -1.0 / 300, -1.0 / 300}, 500);
  const Alignment siding =
      Alignment::chained({far.easting_m, far.northing_m, far.heading_rad + core::kPi}, {{500, 1.0 / 300, 1.0 / 300}});
  map.edges = {{1, "main", 1, 2, "line 1", main}, {2, "on", 2, 3, "line 1", on}, {3, "siding", 4, 2, "", siding}};
  map.edges[0].speed_limits = {{0, 600, 20, Direction::unknown}, {400, 1000, 30, Direction::reverse}};
  map.nodes = {{1, NodeKind::end, "", 2680000, 1250000},
               {2, NodeKind::railway_switch, "W1", at_switch.easting_m, at_switch.northing_m},
               {3, NodeKind::end, "", on.at(800).pose.easting_m, on.at(800).pose.northing_m},
               {4, NodeKind::end, "", far.easting_m, far.northing_m}};
  map.connections = {{2, 1, 2, false}, {2, 1, 3, true}};
  map.landmarks = {{1, LandmarkKind::balise, 1, 900, 0, 0.1, "B1"},
                   {2, LandmarkKind::portal_in, 3, 100, 2.5, 0.5, "tunnel"},
                   {3, LandmarkKind::mast, 1, 300, -3, 0.2, ""}};
  map.balise_groups = {{85, 100, 1, 900, true, false, 5, {1}}, {85, 101, 3, 50, true, true, 5, {}}};
  return map;
}

}  // namespace railfix::track
