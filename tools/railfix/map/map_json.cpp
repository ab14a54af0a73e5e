#include <iostream>

#include "core/json_text.hpp"
#include "map/map_text.hpp"

namespace railfix::tool {

using nlohmann::ordered_json;

namespace {

ordered_json limits_json(const track::Edge& edge) {
  ordered_json limits = ordered_json::array();
  for (const track::SpeedLimit& limit : edge.speed_limits) {
    const char* ways[] = {"both", "forward", "reverse"};
    limits.push_back({{"from_m", limit.from_m},
                      {"to_m", limit.to_m},
                      {"speed_mps", limit.speed_mps},
                      {"direction", ways[static_cast<size_t>(limit.direction)]}});
  }
  return limits;
}

ordered_json edges_json(const track::Map& map) {
  ordered_json edges = ordered_json::array();
  for (const track::Edge& edge : map.edges) {
    edges.push_back({{"id", edge.id},
                     {"name", edge.name},
                     {"line", edge.line},
                     {"length_m", edge.alignment.length_m()},
                     {"from_node", edge.from_node},
                     {"to_node", edge.to_node},
                     {"elements", edge.alignment.elements().size()},
                     {"speed_limits", limits_json(edge)}});
  }
  return edges;
}

/// A switch with its ways: pairs of edges, the straight way first.
ordered_json switches_json(const track::Map& map) {
  ordered_json switches = ordered_json::array();
  for (const track::Node& node : map.nodes) {
    if (node.kind != track::NodeKind::railway_switch) continue;
    ordered_json ways = ordered_json::array();
    for (const track::Connection& way : map.connections) {
      if (way.node == node.id)
        ways.push_back({{"edge_a", way.edge_a}, {"edge_b", way.edge_b}, {"diverging", way.diverging}});
    }
    switches.push_back({{"node", node.id},
                        {"name", node.name},
                        {"easting_m", node.easting_m},
                        {"northing_m", node.northing_m},
                        {"ways", ways}});
  }
  return switches;
}

ordered_json marks_json(const track::Map& map) {
  ordered_json landmarks = ordered_json::array();
  for (const track::Landmark& mark : map.landmarks) {
    landmarks.push_back({{"id", mark.id},
                         {"kind", track::to_string(mark.kind)},
                         {"edge", mark.edge},
                         {"offset_m", mark.offset_m},
                         {"lateral_m", mark.lateral_m},
                         {"sigma_m", mark.sigma_m},
                         {"name", mark.name}});
  }
  return landmarks;
}

ordered_json groups_json(const track::Map& map) {
  ordered_json groups = ordered_json::array();
  for (const track::BaliseGroup& group : map.balise_groups) {
    groups.push_back({{"nid_c", group.nid_c},
                      {"nid_bg", group.nid_bg},
                      {"edge", group.edge},
                      {"offset_m", group.offset_m},
                      {"nominal_is_forward", group.nominal_is_forward},
                      {"is_virtual", group.is_virtual},
                      {"q_locacc_m", group.q_locacc_m}});
  }
  return groups;
}

}  // namespace

ordered_json to_json(const track::FitReport& fit) {
  ordered_json elements = ordered_json::array();
  for (const track::FittedElement& element : fit.elements) {
    elements.push_back({{"track", element.track},
                        {"offset_m", element.offset_m},
                        {"kind", kind_of(element.element)},
                        {"length_m", element.element.length_m},
                        {"curvature_start_per_m", element.element.curvature_start_per_m},
                        {"curvature_end_per_m", element.element.curvature_end_per_m},
                        {"max_point_distance_m", element.max_m}});
  }
  return {{"tracks", fit.tracks},         {"left_as_arcs", fit.left_as_arcs},
          {"two_points", fit.two_points}, {"left_out_points", fit.left_out},
          {"arcs_m", fit.arcs_m},         {"rms_m", fit.rms_m()},
          {"max_m", fit.max_m},           {"elements", elements}};
}

ordered_json to_json(const track::FitFigures& figures) {
  return {{"elements", figures.elements},
          {"max_end_error_m", figures.max_end_error_m},
          {"max_length_change_m", figures.max_length_change_m},
          {"max_heading_step_rad", figures.max_heading_step_rad},
          {"max_gap_m", figures.max_gap_m},
          {"max_point_distance_m", figures.max_point_distance_m},
          {"max_chord_deviation_m", figures.max_chord_deviation_m}};
}

ordered_json to_json(const track::VirtualBalises& groups) {
  return {{"groups", groups.groups}, {"short_edges", groups.short_edges}, {"short_m", groups.short_m}};
}

ordered_json map_json(const track::Map& map) {
  return {{"name", map.name},
          {"source", map.source},
          {"crs", map.crs},
          {"q_locacc_m", map.q_locacc_m},
          {"length_m", total_length_m(map)},
          {"edges", edges_json(map)},
          {"switches", switches_json(map)},
          {"landmarks", marks_json(map)},
          {"balise_groups", groups_json(map)},
          {"learnt_runs", map.learnt_runs},
          {"problems", map.problems}};
}

void print_json(const ordered_json& json) {
  std::cout << core::json_text(json, 2) << '\n';
}

}  // namespace railfix::tool
