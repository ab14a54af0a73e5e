// One turnout from a straight track, with its frogs.
#pragma once

#include <cmath>
#include <string>
#include <vector>

#include "track/import/finish.hpp"
#include "track/map.hpp"

namespace railfix::testing {

inline constexpr double kTurnoutStemM = 400;

/// Edge 1 is the stem, edge 2 goes straight on, edge 3 to the left; level, or up to 120 m before and behind the points
/// on a crest (negative) or in a sag.
inline track::Map turnout(double radius_m, double vertical_curvature_per_m = 0) {
  constexpr double kLegM = 400;
  constexpr double kApartM = 3;  // the legs, where the turnout's arc ends
  track::Map map;
  map.name = "turnout";
  constexpr double kBentM = 120;
  const auto profile = [&](bool before, double length_m) -> std::vector<track::GradePoint> {
    if (vertical_curvature_per_m == 0) return {};
    const double grade = vertical_curvature_per_m * kBentM * (before ? -1 : 1);
    const double bend_m = before ? length_m - 0.5 * kBentM : 0.5 * kBentM;
    const auto height_m = [&](double offset_m) {
      return (offset_m < bend_m) == before ? grade * (offset_m - bend_m) : 0.0;
    };
    return {{0, height_m(0)}, {bend_m, 0, kBentM}, {length_m, height_m(length_m)}};
  };
  const auto edge = [&](uint32_t to, const track::PlanPose& from, const std::vector<track::Element>& elements) {
    const auto id = static_cast<uint32_t>(map.edges.size() + 1);
    const uint32_t begin = id == 1 ? 1 : 2;
    const double length_m = id == 1 ? kTurnoutStemM : kLegM;
    map.edges.push_back({id, "edge " + std::to_string(id), begin, to, "1",
                         track::Alignment::chained(from, elements, profile(id == 1, length_m))});
    const auto& pose = map.edges.back().alignment.at(map.edges.back().alignment.length_m()).pose;
    map.nodes.push_back(
        {to, to == 2 ? track::NodeKind::railway_switch : track::NodeKind::end, "", pose.easting_m, pose.northing_m});
    return pose;
  };
  map.nodes.push_back({1, track::NodeKind::end, "", 0, 0});
  const auto points = edge(2, {0, 0, 0.4}, {{kTurnoutStemM, 0, 0}});
  edge(3, points, {{kLegM, 0, 0}});
  const double arc_m = std::sqrt(2 * radius_m * kApartM);
  edge(4, points, {{arc_m, 1 / radius_m, 1 / radius_m}, {kLegM - arc_m, 0, 0}});
  map.connections = {{2, 1, 2, false}, {2, 1, 3, true}};
  track::add_frogs(map, 0.02);
  return map;
}

}  // namespace railfix::testing
