#include <algorithm>
#include <cmath>
#include <cstdio>
#include <iostream>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <numeric>
#include <string>
#include <vector>

#include "commands.hpp"
#include "core/result.hpp"
#include "core/units.hpp"
#include "map/map_commands.hpp"
#include "track/import/build.hpp"
#include "track/import/made_network.hpp"

namespace railfix::tool {
namespace {

using nlohmann::ordered_json;

double total_length_m(const track::Map& map) {
  return std::accumulate(map.edges.begin(), map.edges.end(), 0.0,
                         [](double sum, const track::Edge& edge) { return sum + edge.alignment.length_m(); });
}

/// Track with a speed limit in one direction or both.
double limited_m(const track::Map& map) {
  double sum = 0;
  for (const track::Edge& edge : map.edges) {
    std::vector<std::pair<double, double>> parts;
    for (const track::SpeedLimit& limit : edge.speed_limits) parts.emplace_back(limit.from_m, limit.to_m);
    std::sort(parts.begin(), parts.end());
    double reached = 0;
    for (const auto& [from, to] : parts) {
      sum += std::max(0.0, to - std::max(from, reached));
      reached = std::max(reached, to);
    }
  }
  return sum;
}

size_t count_of(const track::Map& map, track::NodeKind kind) {
  return static_cast<size_t>(
      std::count_if(map.nodes.begin(), map.nodes.end(), [&](const track::Node& node) { return node.kind == kind; }));
}

void print_problems(const std::vector<std::string>& problems, size_t most) {
  if (problems.empty()) {
    std::puts("problems         none found");
    return;
  }
  std::printf("problems         %zu\n", problems.size());
  for (size_t i = 0; i < std::min(most, problems.size()); ++i) std::printf("  - %s\n", problems[i].c_str());
  if (problems.size() > most)
    std::printf("  ... and %zu more; `railfix map info MAP --json` lists all\n", problems.size() - most);
}

void print_summary(const track::Map& map) {
  std::printf("map              %s, from %s\n", map.name.c_str(), map.source.c_str());
  std::printf("coordinates      %s\n", map.crs.empty() ? "local metres, no latitude and longitude" : map.crs.c_str());
  std::printf("track            %.3f km in %zu edges\n", total_length_m(map) / 1000.0, map.edges.size());
  std::printf("nodes            %zu switches, %zu crossings, %zu joints, %zu ends\n",
              count_of(map, track::NodeKind::railway_switch), count_of(map, track::NodeKind::crossing),
              count_of(map, track::NodeKind::joint), count_of(map, track::NodeKind::end));
  std::printf("landmarks        %zu, balise groups %zu\n", map.landmarks.size(), map.balise_groups.size());
  const double limited = limited_m(map);
  if (limited > 0) std::printf("speed limits     on %.3f km\n", limited / 1000.0);
}

void print_figures(const char* source, const track::FitFigures& figures) {
  if (figures.elements == 0) return;
  std::printf("%s\n", source);
  std::printf("  elements                      %zu\n", figures.elements);
  std::printf("  integrated end against file   %.6f mm at most\n", figures.max_end_error_m * 1e3);
  std::printf("  heading from one to the next  %.6f rad at most\n", figures.max_heading_step_rad);
  if (figures.max_chord_deviation_m > 0) {
    std::printf("  track from the mapped points  %.3f m at most\n", figures.max_point_distance_m);
    std::printf("  track against the polyline    %.3f m at most\n", figures.max_chord_deviation_m);
  } else {
    std::printf("  length against file           %.6f mm at most\n", figures.max_length_change_m * 1e3);
    std::printf("  gaps between the file's own   %.6f mm at most\n", figures.max_gap_m * 1e3);
  }
}

const char* kind_of(const track::Element& element) {
  if (element.curvature_start_per_m != element.curvature_end_per_m) return "clothoid";
  return element.curvature_start_per_m == 0 ? "straight" : "arc";
}

/// Straights, clothoids and arcs, and the elements that fit worst.
void print_fit(const track::FitReport& fit) {
  if (fit.tracks + fit.left_as_arcs + fit.two_points == 0) return;
  std::map<std::string, size_t> count;
  for (const track::FittedElement& element : fit.elements) ++count[kind_of(element.element)];
  std::printf("polylines as straights, clothoids and arcs\n");
  std::printf("  tracks                        %zu, %zu more left as arcs through their points, %zu of two points\n",
              fit.tracks, fit.left_as_arcs, fit.two_points);
  std::printf("  left out, still arcs          %zu points apart from their track, %.0f m of these tracks\n",
              fit.left_out, fit.arcs_m);
  std::printf("  elements                      %zu straights, %zu clothoids, %zu arcs\n", count["straight"],
              count["clothoid"], count["arc"]);
  std::printf("  points from the track         %.3f m rms, %.3f m at most\n", fit.rms_m(), fit.max_m);
  std::vector<track::FittedElement> worst = fit.elements;
  const auto shown = static_cast<ptrdiff_t>(std::min<size_t>(5, worst.size()));
  std::partial_sort(worst.begin(), worst.begin() + shown, worst.end(),
                    [](const auto& a, const auto& b) { return a.max_m > b.max_m; });
  for (ptrdiff_t i = 0; i < shown; ++i) {
    std::printf("  worst                         %.3f m beside the %s of %s at %.1f m\n", worst[i].max_m,
                kind_of(worst[i].element), worst[i].track.c_str(), worst[i].offset_m);
  }
}

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

ordered_json map_json(const track::Map& map) {
  return {{"name", map.name},
          {"source", map.source},
          {"crs", map.crs},
          {"length_m", total_length_m(map)},
          {"edges", edges_json(map)},
          {"switches", switches_json(map)},
          {"landmarks", marks_json(map)},
          {"balise_groups", groups_json(map)},
          {"problems", map.problems}};
}

void print_json(const ordered_json& json) {
  // Names come from foreign files; broken UTF-8 in them must not end the listing.
  std::cout << json.dump(2, ' ', false, ordered_json::error_handler_t::replace) << '\n';
}

void print_info(const track::Map& map, size_t most_edges) {
  print_summary(map);
  std::printf("\n%6s  %12s  %6s  %6s  %-24s %s\n", "edge", "length [m]", "from", "to", "name", "line");
  for (size_t i = 0; i < std::min(most_edges, map.edges.size()); ++i) {
    const track::Edge& edge = map.edges[i];
    std::printf("%6u  %12.3f  %6u  %6u  %-24s %s\n", edge.id, edge.alignment.length_m(), edge.from_node, edge.to_node,
                edge.name.c_str(), edge.line.c_str());
  }
  if (map.edges.size() > most_edges)
    std::printf("  ... and %zu more; --json lists all\n", map.edges.size() - most_edges);
  std::puts("");
  print_problems(map.problems, 20);
}

void print_place(const track::Map& map, const track::EdgePosition& place, bool as_json) {
  // Seen along growing offset, or against it where the place says so; + 0.0 makes -0 a plain 0.
  const bool reverse = place.direction == track::Direction::reverse;
  const double sign = reverse ? -1.0 : 1.0;
  const track::TrackPoint point = map.edge(place.edge)->alignment.at(place.offset_m);
  const double heading = core::wrap_pi(point.pose.heading_rad + (reverse ? core::kPi : 0.0));
  const auto geo = map.to_geo(point.pose.easting_m, point.pose.northing_m);
  const auto limit =
      map.edge(place.edge)
          ->speed_limit_mps(place.offset_m, reverse ? track::Direction::reverse : track::Direction::forward);
  if (as_json) {
    print_json({{"edge", place.edge},
                {"offset_m", place.offset_m},
                {"easting_m", point.pose.easting_m},
                {"northing_m", point.pose.northing_m},
                {"heading_rad", heading},
                {"curvature_per_m", sign * point.curvature_per_m + 0.0},
                {"curvature_rate_per_m2", point.curvature_rate_per_m2},
                {"cant_m", sign * point.cant_m + 0.0},
                {"twist", point.twist},
                {"elevation_m", point.elevation_m},
                {"grade", sign * point.grade + 0.0},
                {"speed_limit_mps", limit ? ordered_json(*limit) : ordered_json()},
                {"lat_deg", geo ? ordered_json(geo->lat_deg) : ordered_json()},
                {"lon_deg", geo ? ordered_json(geo->lon_deg) : ordered_json()}});
    return;
  }
  std::printf("edge %u at %.3f m%s\n", place.edge, place.offset_m, reverse ? ", seen against growing offset" : "");
  std::printf("easting          %.4f m\nnorthing         %.4f m\n", point.pose.easting_m, point.pose.northing_m);
  std::printf("heading          %.6f rad (%.3f degrees clockwise from grid north)\n", heading,
              core::deg_from_rad(heading));
  const double curvature = sign * point.curvature_per_m;
  if (std::abs(curvature) < 1e-7) {
    std::puts("curvature        straight");
  } else {
    std::printf("curvature        %.3e per m (radius %.1f m to the %s)\n", curvature, 1.0 / std::abs(curvature),
                curvature > 0 ? "left" : "right");
  }
  std::printf("cant             %.1f mm\n", sign * point.cant_m * 1e3);
  std::printf("elevation, grade %.3f m, %.2f per mille\n", point.elevation_m, sign * point.grade * 1e3);
  if (limit) std::printf("speed limit      %.0f km/h\n", core::kmh_from_mps(*limit));
  if (geo) std::printf("latitude         %.8f\nlongitude        %.8f\n", geo->lat_deg, geo->lon_deg);
}

struct BuildRequest {
  std::vector<std::string> inputs;
  std::string out;
  bool as_json = false;
  track::BuildOptions options;
};

int build(const BuildRequest& request) {
  const std::vector<std::filesystem::path> inputs(request.inputs.begin(), request.inputs.end());
  const track::BuiltMap built = core::value_or_throw(track::build_map(inputs, request.options));
  core::ok_or_throw(built.map.save(request.out));
  if (request.as_json) {
    ordered_json json{{"out", request.out},
                      {"edges", built.map.edges.size()},
                      {"length_m", total_length_m(built.map)},
                      {"crs", built.map.crs}};
    if (built.landxml.elements > 0) json["landxml"] = to_json(built.landxml);
    if (built.fit.tracks > 0) json["fit"] = to_json(built.fit);
    if (built.plans.elements > 0) json["plans"] = to_json(built.plans);
    if (built.osm.elements > 0) json["osm"] = to_json(built.osm);
    json["problems"] = built.map.problems;
    print_json(json);
    return 0;
  }
  print_summary(built.map);
  print_figures("LandXML, element by element", built.landxml);
  print_figures("Coordinates of a plan, arcs through the points", built.plans);
  print_figures("OpenStreetMap, arcs through the points", built.osm);
  print_fit(built.fit);
  print_problems(built.map.problems, 20);
  std::printf("written          %s\n", request.out.c_str());
  return 0;
}

struct InfoRequest {
  std::string map;
  std::string at;
  bool as_json = false;
};

int info(const InfoRequest& request) {
  const track::Map map = core::value_or_throw(track::Map::load(request.map));
  if (!request.at.empty()) {
    print_place(map, core::value_or_throw(map.parse_position(request.at)), request.as_json);
  } else if (request.as_json) {
    print_json(map_json(map));
  } else {
    print_info(map, 50);
  }
  return 0;
}

void add_build(CLI::App& map, Action& chosen) {
  const auto request = std::make_shared<BuildRequest>();
  CLI::App* command = map.add_subcommand("build", "Make a map out of surveys and OpenStreetMap data, and check it");
  command
      ->add_option(
          "INPUT", request->inputs,
          "LandXML (.xml, .landxml), railML 2 and 3 (.xml, .railml), ERJU infrastructure and map (.xml, both), "
          "OpenStreetMap (.osm, .pbf), Overpass JSON (.json), GeoJSON (.geojson), compiled map (.map)")
      ->required();
  command->add_option("--out", request->out, "The map file to write")->required();
  command->add_option(
      "--crs", request->options.crs,
      "Coordinate system for PROJ, such as EPSG:2056; without it the plan's own, else the UTM zone of the data; "
      "local = true to scale around the middle of OpenStreetMap data (UTM shortens up to 0.4 m per km)");
  command->add_flag(
      "!--arcs", request->options.with_clothoids,
      "Two arcs between every pair of points of OpenStreetMap, through every point, instead of straights, "
      "clothoids and arcs that pass them within their scatter");
  request->options.with_clothoids = true;
  command->add_flag("--trams", request->options.with_trams, "Take railway=tram too");
  command
      ->add_option("--smooth", request->options.smooth_m,
                   "Let the points of OpenStreetMap move by up to so many metres, so that the curvature is even")
      ->check(CLI::Range(0.0, 10.0));
  command
      ->add_option("--virtual-balises", request->options.virtual_balises_every_m,
                   "Virtual balise groups about every so many metres along every edge")
      ->check(CLI::Range(1.0, 1e6));
  command->add_option("--nid-c", request->options.nid_c, "NID_C of the virtual balise groups")
      ->check(CLI::Range(0, 1023))
      ->capture_default_str();
  command->add_option("--first-nid-bg", request->options.first_nid_bg, "NID_BG of the first virtual balise group")
      ->check(CLI::Range(0, 16382))
      ->capture_default_str();
  command
      ->add_option("--landmarks", request->options.landmarks,
                   "Keep landmarks of these kinds alone, for example frog,portal_in,portal_out (default: all)")
      ->delimiter(',');
  command->add_flag("--json", request->as_json, "The figures and problems as JSON on standard output");
  command->footer(
      "Examples:\n"
      "  railfix map build line.landxml --out line.map\n"
      "  railfix map build region.osm.pbf --crs EPSG:32633 --virtual-balises 500 --out region.map");
  command->callback([request, &chosen] { chosen = [request] { return build(*request); }; });
}

void add_info(CLI::App& map, Action& chosen) {
  const auto request = std::make_shared<InfoRequest>();
  CLI::App* command = map.add_subcommand("info", "What a map holds, or everything about one place on it");
  command->add_option("MAP", request->map, "A map made by `railfix map build`")->required();
  command->add_option("--at", request->at,
                      "EDGE:OFFSET[:+|-], EDGE a number or a name: position, heading, curvature, cant, grade there");
  command->add_flag("--json", request->as_json, "JSON on standard output");
  command->footer(
      "Examples:\n"
      "  railfix map info line.map\n"
      "  railfix map info line.map --at 1:1250.5 --json");
  command->callback([request, &chosen] { chosen = [request] { return info(*request); }; });
}

void add_make(CLI::App& map, Action& chosen) {
  struct MakeRequest {
    std::string out;
    track::MadeNetworkOptions options;
  };
  const auto request = std::make_shared<MakeRequest>();
  CLI::App* command = map.add_subcommand("make", "Make up a railway network of any size, for tests");
  command->add_option("--out", request->out, "The map file to write")->required();
  command->add_option("--track-km", request->options.track_km, "Length of all tracks together")
      ->check(CLI::Range(20.0, 100000.0))
      ->capture_default_str();
  command->add_option("--seed", request->options.seed, "Another network of the same kind")->capture_default_str();
  command->add_option("--masts", request->options.mast_spacing_m, "Masts about every so many metres; 0 = none")
      ->check(CLI::Range(0.0, 1000.0))
      ->capture_default_str();
  command->footer("Example:\n  railfix map make --track-km 20000 --seed 1 --out national.map");
  command->callback([request, &chosen] {
    chosen = [request] {
      const track::Map made = track::made_network(request->options);
      core::ok_or_throw(made.save(request->out));
      print_summary(made);
      std::printf("written          %s\n", request->out.c_str());
      return 0;
    };
  });
}

}  // namespace

void add_map(CLI::App& app, Action& chosen) {
  CLI::App* map = app.add_subcommand("map", "Build maps of the track and look into them");
  map->require_subcommand(1);
  add_build(*map, chosen);
  add_info(*map, chosen);
  add_make(*map, chosen);
  add_map_draw(*map, chosen);
  add_map_coverage(*map, chosen);
  add_map_learn(*map, chosen);
  add_map_locate(*map, chosen);
}

}  // namespace railfix::tool
