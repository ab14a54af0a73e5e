#include "map/map_commands.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "core/units.hpp"
#include "map/coverage.hpp"
#include "map/drawing.hpp"
#include "map/survey.hpp"
#include "number_between.hpp"
#include "output_file.hpp"

namespace railfix::tool {
namespace {

using nlohmann::ordered_json;

struct DrawRequest {
  std::string map;
  std::string out;
  std::optional<std::string> at;
  DrawOptions options;
};

int draw(DrawRequest request) {
  check_output("--out", request.out, {request.map});
  const track::Map map = core::value_or_throw(track::Map::load(request.map));
  if (request.at) request.options.around = core::value_or_throw(map.parse_position(*request.at));
  core::ok_or_throw(write_drawing(draw_map(map, request.options), request.out));
  say_beside({request.out});
  std::printf("written          %s\n", request.out.c_str());
  return 0;
}

struct CoverageRequest {
  std::string map;
  std::string start = "1:0";
  double length_m = 1e7;
  bool as_json = false;
  CoverageOptions options;
};

std::string place_text(const track::Path& path, double distance_m) {
  const track::EdgePosition place = path.position_at(distance_m);
  char text[64];
  std::snprintf(text, sizeof text, "%u:%.0f%s", place.edge, place.offset_m,
                place.direction == track::Direction::reverse ? ":-" : "");
  return text;
}

ordered_json coverage_json(const track::Path& path, const Coverage& found) {
  ordered_json gaps = ordered_json::array();
  for (const CoverageGap& gap : found.gaps) {
    ordered_json places = ordered_json::array();
    for (const double at : gap.references_m) places.push_back(place_text(path, at));
    gaps.push_back({{"from", place_text(path, gap.from_m)},
                    {"to", place_text(path, gap.to_m)},
                    {"length_m", std::abs(gap.to_m - gap.from_m)},
                    {"largest_half_interval_m", gap.largest_m},
                    {"outside_subset_041", gap.outside_budget},
                    {"virtual_references", places}});
  }
  return {{"way_m", path.end_m() - path.begin_m()},
          {"references", found.references},
          {"covered_m", found.covered_m},
          {"largest_half_interval_m", found.largest_m},
          {"gaps", gaps}};
}

void print_coverage(const char* way_name, const track::Path& path, const Coverage& found) {
  const double way = path.end_m() - path.begin_m();
  std::printf("within, %-8s %.1f km (%.1f %%), largest %.1f m\n", way_name, found.covered_m / 1e3,
              100 * found.covered_m / std::max(way, 1.0), found.largest_m);
  for (const CoverageGap& gap : found.gaps) {
    std::printf("  too wide       %s to %s (%.0f m), up to %.1f m%s\n", place_text(path, gap.from_m).c_str(),
                place_text(path, gap.to_m).c_str(), std::abs(gap.to_m - gap.from_m), gap.largest_m,
                gap.outside_budget ? ", beyond 5 m + 5 %" : "");
    std::printf("    reference at");
    if (gap.references_m.empty()) std::printf(" no place helps: a virtual one is not better than the limit");
    for (const double at : gap.references_m) std::printf(" %s", place_text(path, at).c_str());
    std::printf("\n");
  }
}

int coverage(const CoverageRequest& request) {
  const auto map = std::make_shared<const track::Map>(core::value_or_throw(track::Map::load(request.map)));
  const track::EdgePosition start = core::value_or_throw(map->parse_position(request.start));
  const track::Path path = core::value_or_throw(way_from(map, start, request.length_m));
  const Coverage found = coverage_of(path, request.options);
  const Coverage back = coverage_of(path, request.options, true);
  if (request.as_json) {
    ordered_json json = coverage_json(path, found);
    json["back"] = coverage_json(path, back);
    std::cout << json.dump(2) << '\n';
    return 0;
  }
  const double way = path.end_m() - path.begin_m();
  std::printf("way              %.1f km from %s over the straight way of every switch\n", way / 1e3,
              request.start.c_str());
  std::printf("references       %zu\n", found.references);
  std::printf("limit            %.1f m on either side, %.2f %% drift (1 sigma), %.1f sigma\n", request.options.limit_m,
              100 * request.options.scale_sigma, request.options.sigmas);
  print_coverage("there", path, found);
  print_coverage("back", path, back);
  return 0;
}

struct LearnRequest {
  std::string map;
  std::vector<std::string> runs;
  std::string out;
  SurveyOptions options;
};

int learn(const LearnRequest& request) {
  std::vector<std::filesystem::path> inputs(request.runs.begin(), request.runs.end());
  inputs.emplace_back(request.map);
  check_output("--out", request.out, inputs);
  const auto map = std::make_shared<const track::Map>(core::value_or_throw(track::Map::load(request.map)));
  const auto [sightings, placeless] = core::value_or_throw(read_runs(map, {request.runs.begin(), request.runs.end()}));
  const Survey survey = survey_landmarks(*map, sightings, request.options);
  track::Map updated = *map;
  apply_survey(survey, updated);
  core::ok_or_throw(updated.save(request.out));
  say_beside({request.out});
  std::printf(
      "sightings        %zu of %zu runs, %zu used, %zu outliers, %zu of new things seen by fewer than %zu runs\n",
      sightings.size(), request.runs.size(), survey.sightings, survey.outliers, survey.left_alone,
      request.options.least_runs);
  if (placeless > 0)
    std::printf("without a place  %zu more, where the track was not known or is not on the map\n", placeless);
  for (size_t run = 0; run < request.runs.size(); ++run) {
    if (std::ranges::none_of(sightings, [run](const SurveySighting& sighting) { return sighting.run == run; }))
      std::printf("nothing seen     %s has no sighting with a place on the map\n", request.runs[run].c_str());
  }
  std::printf("errors           %.2f of their sigmas (rms)\n\n", survey.spread);
  std::printf("%-10s %6s %12s %9s %9s %5s %9s  %s\n", "kind", "edge", "offset [m]", "sigma [m]", "moved [m]", "runs",
              "sightings", "on the map as");
  for (const SurveyedLandmark& found : survey.landmarks) {
    const track::Landmark& mark = found.landmark;
    std::printf("%-10s %6u %12.3f %9.3f %9.3f %5zu %9zu  %s\n", track::to_string(mark.kind).c_str(), mark.edge,
                mark.offset_m, mark.sigma_m, found.moved_m, found.runs, found.sightings,
                found.known_id != 0 ? (std::to_string(found.known_id) + " " + mark.name).c_str() : "new");
  }
  std::printf("written          %s\n", request.out.c_str());
  return 0;
}

}  // namespace

void add_map_draw(CLI::App& map, Action& chosen) {
  const auto request = std::make_shared<DrawRequest>();
  CLI::App* command = map.add_subcommand("draw", "Draw a map as SVG or PNG");
  command->add_option("MAP", request->map, "A map made by `railfix map build`")->required();
  command->add_option("--out", request->out, "The picture to write, .svg or .png")->required();
  command->add_option("--at", request->at, "EDGE:OFFSET, a place to look at closely");
  command->add_option("--radius", request->options.radius_m, "Metres around that place")
      ->check(number_between(1.0, 1e6))
      ->capture_default_str();
  command->add_option("--width", request->options.width_px, "Pixels")
      ->check(number_between(200.0, 8000.0))
      ->capture_default_str();
  command->footer(
      "Examples:\n  railfix map draw line.map --out line.svg\n"
      "  railfix map draw line.map --at 1:1250 --radius 300 --out switch.png");
  command->callback([request, &chosen] { chosen = [request] { return draw(*request); }; });
}

void add_map_coverage(CLI::App& map, Action& chosen) {
  const auto request = std::make_shared<CoverageRequest>();
  CLI::App* command =
      map.add_subcommand("coverage", "Where the confidence interval outgrows a limit for lack of references");
  command->add_option("MAP", request->map, "A map made by `railfix map build`")->required();
  command->add_option("--start", request->start, "EDGE:OFFSET[:+|-] where the way begins")->capture_default_str();
  command->add_option("--length", request->length_m, "Metres of way; the whole line without");
  command->add_option("--limit", request->options.limit_m, "Metres that half the interval may be long")
      ->check(number_between(0.1, 1e5))
      ->capture_default_str();
  command
      ->add_option("--scale-sigma", request->options.scale_sigma, "Drift of the odometry as a part of the way, 1 sigma")
      ->check(number_between(1e-6, 0.1))
      ->capture_default_str();
  command->add_option("--sigmas", request->options.sigmas, "Half the interval in sigmas of the drift")
      ->check(number_between(0.1, 10.0))
      ->capture_default_str();
  command->add_option("--virtual-locacc", request->options.virtual_locacc_m, "Q_LOCACC of proposed references, metres")
      ->check(number_between(0.0, 63.0))
      ->capture_default_str();
  command->add_flag("--natural", request->options.natural, "Count frogs, portals, bridges, masts and platforms too");
  command->add_flag("--json", request->as_json, "JSON on standard output");
  command->footer("Example:\n  railfix map coverage line.map --start 1:0 --limit 15 --scale-sigma 0.001");
  command->callback([request, &chosen] { chosen = [request] { return coverage(*request); }; });
}

void add_map_learn(CLI::App& map, Action& chosen) {
  const auto request = std::make_shared<LearnRequest>();
  CLI::App* command =
      map.add_subcommand("learn", "Survey natural reference points from the sightings of recorded runs");
  command->add_option("MAP", request->map, "The map that the runs were made on")->required();
  command->add_option("RUN", request->runs, "Folders that `railfix run --out` wrote, several passes")->required();
  command->add_option("--out", request->out, "The map to write")->required();
  command->add_option("--least-runs", request->options.least_runs, "A new landmark must be seen by as many runs")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  command->add_option("--gate", request->options.gate_m, "Sightings within so many metres are of one thing")
      ->check(number_between(0.1, 50.0))
      ->capture_default_str();
  command->footer("Example:\n  railfix map learn line.map RUN1 RUN2 RUN3 --out surveyed.map");
  command->callback([request, &chosen] { chosen = [request] { return learn(*request); }; });
}

}  // namespace railfix::tool
