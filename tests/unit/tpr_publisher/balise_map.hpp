// A line with balise groups of every sort, through a switch.
//
//   --- edge 1 (1000 m) --- switch --- edge 2 (1000 m)       groups: A 100, B 400, C 700 on 1; D 200 on 2; E 400 on 3
//                               \____ edge 3 (500 m), drawn towards the switch
#pragma once

#include "core/units.hpp"
#include "track/map.hpp"

namespace railfix::tpr_publisher::testing {

constexpr uint32_t kA = 85U << 14U | 1U;  // real, two balises
constexpr uint32_t kB = 85U << 14U | 2U;  // virtual, nominal against the edge
constexpr uint32_t kC = 85U << 14U | 3U;  // real, a single balise
constexpr uint32_t kD = 85U << 14U | 4U;  // virtual
constexpr uint32_t kE = 85U << 14U | 5U;  // virtual

inline std::shared_ptr<const track::Map> balise_map() {
  using track::Alignment;
  auto map = std::make_shared<track::Map>();
  const track::PlanPose start{0, 0, core::kPi / 2};
  const auto main = Alignment::chained(start, {{1000, 0, 0}});
  const auto at_switch = main.at(1000).pose;
  const auto far = track::advance(at_switch, {500, -1.0 / 300, -1.0 / 300}, 500);
  map->edges = {{1, "main", 1, 2, "", main},
                {2, "on", 2, 3, "", Alignment::chained(at_switch, {{1000, 0, 0}})},
                {3, "siding", 4, 2, "",
                 Alignment::chained({far.easting_m, far.northing_m, far.heading_rad + core::kPi},
                                    {{500, 1.0 / 300, 1.0 / 300}})}};
  map->nodes = {{1, track::NodeKind::end, "", 0, 0},
                {2, track::NodeKind::railway_switch, "", at_switch.easting_m, at_switch.northing_m},
                {3, track::NodeKind::end, "", 2000, 0},
                {4, track::NodeKind::end, "", far.easting_m, far.northing_m}};
  map->connections = {{2, 1, 2, false}, {2, 1, 3, true}};
  map->landmarks = {{1, track::LandmarkKind::balise, 1, 100, 0, 0, ""},
                    {2, track::LandmarkKind::balise, 1, 103, 0, 0, ""},
                    {3, track::LandmarkKind::balise, 1, 700, 0, 0, ""}};
  map->balise_groups = {{85, 1, 1, 100, true, false, 5, {1, 2}},
                        {85, 2, 1, 400, false, true, 5, {}},
                        {85, 3, 1, 700, true, false, 5, {3}},
                        {85, 4, 2, 200, true, true, 5, {}},
                        {85, 5, 3, 400, true, true, 5, {}}};
  return map;
}

inline track::EdgePosition forward(uint32_t edge, double offset_m) {
  return {edge, offset_m, track::Direction::forward};
}
inline track::EdgePosition reverse(uint32_t edge, double offset_m) {
  return {edge, offset_m, track::Direction::reverse};
}

}  // namespace railfix::tpr_publisher::testing
