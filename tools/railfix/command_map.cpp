#include <cstdio>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "commands.hpp"
#include "core/result.hpp"
#include "map/map_commands.hpp"
#include "map/map_text.hpp"
#include "number_between.hpp"
#include "output_file.hpp"
#include "track/import/build.hpp"
#include "track/import/made/made_network.hpp"
#include "track/import/scale.hpp"
#include "whole_number.hpp"

namespace railfix::tool {
namespace {

constexpr double kNearestMastsM = 10;  // as many as that would need more memory than there is

using nlohmann::ordered_json;

struct BuildRequest {
  std::vector<std::string> inputs;
  std::string out;
  bool as_json = false;
  track::BuildOptions options;
};

int build(const BuildRequest& request) {
  const std::vector<std::filesystem::path> inputs(request.inputs.begin(), request.inputs.end());
  check_output("--out", request.out, inputs);
  const track::BuiltMap built = core::value_or_throw(track::build_map(inputs, request.options));
  core::ok_or_throw(built.map.save(request.out));
  say_beside({request.out});
  if (request.as_json) {
    ordered_json json{{"out", request.out},
                      {"edges", built.map.edges.size()},
                      {"length_m", total_length_m(built.map)},
                      {"crs", built.map.crs}};
    if (const auto scale = track::scale_over(built.map))
      json["scale_m_per_km"] = {scale->least_m_per_km, scale->most_m_per_km};
    if (built.landxml.elements > 0) json["landxml"] = to_json(built.landxml);
    if (built.fit.tracks > 0) json["fit"] = to_json(built.fit);
    if (built.plans.elements > 0) json["plans"] = to_json(built.plans);
    if (built.osm.elements > 0) json["osm"] = to_json(built.osm);
    if (built.virtual_balises.was_asked_for()) json["virtual_balises"] = to_json(built.virtual_balises);
    if (!built.crs_remark.empty()) json["remark"] = built.crs_remark;
    json["problems"] = built.map.problems;
    print_json(json);
    return 0;
  }
  print_summary(built.map);
  if (!built.crs_remark.empty()) std::printf("remark           %s\n", built.crs_remark.c_str());
  print_virtual_balises(built.virtual_balises);
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
  std::optional<std::string> at;
  bool as_json = false;
};

int info(const InfoRequest& request) {
  const track::Map map = core::value_or_throw(track::Map::load(request.map));
  if (request.at) {
    print_place(map, core::value_or_throw(map.parse_position(*request.at)), request.as_json);
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
          "OpenStreetMap (.osm, .osm.gz, .osm.bz2, .pbf), Overpass JSON (.json), GeoJSON (.geojson), compiled map "
          "(.map)")
      ->required();
  command->add_option("--out", request->out, "The map file to write")->required();
  command->add_option(
      "--crs", request->options.crs,
      "Coordinate system for PROJ, such as EPSG:2056; without it the plan's own, else the UTM zone of the data; "
      "local = true to scale in the middle of OpenStreetMap data, 0.5 m per km too long 200 km east or west of it. UTM "
      "is 0.4 m per km too short in the middle of its zone and too long beyond 180 km from it");
  command->add_flag(
      "!--arcs", request->options.with_clothoids,
      "Two arcs between every pair of points of OpenStreetMap, through every point, instead of straights, "
      "clothoids and arcs that pass them within their scatter");
  request->options.with_clothoids = true;
  command->add_flag("--trams", request->options.with_trams, "Take railway=tram too");
  command
      ->add_option("--smooth", request->options.smooth_m,
                   "Let the points of OpenStreetMap move by up to so many metres, so that the curvature is even")
      ->check(number_between(0.0, 10.0));
  command
      ->add_option(
          "--virtual-balises", request->options.virtual_balises_every_m,
          "Virtual balise groups about every so many metres along every edge, none on edges shorter than half of it")
      ->check(number_between(1.0, 1e6));
  command
      ->add_option("--virtual-balises-at", request->options.virtual_balises_at,
                   "Virtual balise groups at these places, EDGE:OFFSET as `railfix map coverage` proposes them, with "
                   ":- behind it "
                   "where their nominal direction is against growing offsets")
      ->transform([](std::string place) { return CLI::detail::trim(place); })
      ->delimiter(',')
      ->allow_extra_args(false);
  command
      ->add_option("--nid-c", request->options.virtual_numbers.nid_c,
                   "NID_C of the virtual balise groups, or several as in 85,86: one has 16,382 numbers")
      ->check(CLI::Range(0, 1023))
      ->delimiter(',')
      ->allow_extra_args(false)
      ->capture_default_str();
  command
      ->add_option("--first-nid-bg", request->options.virtual_numbers.first_nid_bg,
                   "NID_BG of the first virtual balise group")
      ->check(CLI::Range(0, 16382))
      ->capture_default_str();
  command
      ->add_option("--q-locacc", request->options.q_locacc_m,
                   "Q_LOCACC in m of balise groups whose source says none (railML, ERJU): that of the trackside's "
                   "linking, else its Q_NVLOCACC")
      ->check(number_between(0.0, 63.0))
      ->capture_default_str();
  command
      ->add_option("--landmarks", request->options.landmarks,
                   "Keep landmarks of these kinds alone, for example frog,portal_in,portal_out (default: all)")
      ->transform([](std::string kind) { return CLI::detail::trim(kind); })
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
      ->check(number_between(20.0, 100000.0))
      ->capture_default_str();
  command->add_option("--seed", request->options.seed, "Another network of the same kind")
      ->check(whole_number())
      ->capture_default_str();
  command->add_option("--masts", request->options.mast_spacing_m, "Masts about every so many metres; 0 = none")
      ->check(number_between(0.0, 1000.0))
      ->check([](const std::string& spacing) {
        const double spacing_m = std::strtod(spacing.c_str(), nullptr);
        return spacing_m > 0 && spacing_m < kNearestMastsM ? "masts nearer than 10 m stand on no line; 0 = none" : "";
      })
      ->capture_default_str();
  command->footer("Example:\n  railfix map make --track-km 20000 --seed 1 --out national.map");
  command->callback([request, &chosen] {
    chosen = [request] {
      check_output("--out", request->out, {});
      const track::Map made = track::made_network(request->options);
      core::ok_or_throw(made.save(request->out));
      say_beside({request->out});
      print_summary(made);
      std::printf("written          %s\n", request->out.c_str());
      return 0;
    };
  });
}

}  // namespace

void add_map(CLI::App& app, Action& chosen) {
  CLI::App* map = app.add_subcommand("map", "Build maps of the track and look into them");
  map->footer("Example: railfix map build line.landxml --out line.map");
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
