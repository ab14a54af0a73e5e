#include "map/map_commands.hpp"

#include <algorithm>
#include <cstdio>
#include <memory>
#include <optional>

#include "map/drawing.hpp"
#include "map/survey.hpp"
#include "number_between.hpp"
#include "output_file.hpp"

namespace railfix::tool {
namespace {

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
  const auto [sightings, placeless, runs] =
      core::value_or_throw(read_runs(map, {request.runs.begin(), request.runs.end()}));
  const Survey survey = survey_landmarks(*map, sightings, request.options);
  track::Map updated = *map;
  apply_survey(survey, updated);
  updated.learnt_runs.insert(updated.learnt_runs.end(), runs.begin(), runs.end());
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
  std::printf("errors           %.2f of their sigmas (rms)\n", survey.spread);
  if (known_ones_stay(*map))
    std::printf(
        "known ones       stay: the map has learnt from %zu runs before, and all sightings of a thing err alike; to "
        "better them, learn from all runs at once on the map of before\n",
        map->learnt_runs.size());
  std::puts("");
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
