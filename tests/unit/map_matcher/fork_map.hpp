// One facing switch.
#pragma once

#include <memory>

#include "track/map.hpp"

namespace railfix::map_matcher {

/// Goes straight on at 500 m, or to the left. Each leg has its frog.
inline std::shared_ptr<const track::Map> fork() {
  auto map = std::make_shared<track::Map>();
  map->edges.push_back({1, "stem", 1, 2, "", track::Alignment::chained({0, 0, 0}, {{500, 0, 0}})});
  map->edges.push_back({2, "straight", 2, 3, "", track::Alignment::chained({0, 500, 0}, {{500, 0, 0}})});
  map->edges.push_back(
      {3, "left", 2, 4, "", track::Alignment::chained({0, 500, 0}, {{40, 0.003, 0.003}, {460, 0, 0}})});
  map->nodes = {{2, track::NodeKind::railway_switch, "", 0, 500}};
  map->connections = {{2, 1, 2, false}, {2, 1, 3, true}};
  map->landmarks = {{1, track::LandmarkKind::frog, 2, 30, 0.72, 0.1, ""},
                    {2, track::LandmarkKind::frog, 3, 30, -0.72, 0.1, ""}};
  return map;
}

}  // namespace railfix::map_matcher
