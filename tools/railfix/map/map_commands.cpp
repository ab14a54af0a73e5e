#include "map/map_commands.hpp"

#include <algorithm>
#include <array>
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

void print_runs(const ReadSightings& read, const LearnRequest& request, const Survey& survey) {
  std::printf(
      "sightings        %zu of %zu runs, %zu used, %zu outliers, %zu of new things seen by fewer than %zu runs\n",
      read.placed.size(), request.runs.size(), survey.sightings, survey.outliers, survey.left_alone,
      request.options.least_runs);
  if (read.placeless > 0)
    std::printf("without a place  %zu more, where track or place was not known or is not on the map\n", read.placeless);
  if (read.doubtful > 0)
    std::printf("left out         %zu more, of a confidence below %.2f or a kind that no camera tells\n", read.doubtful,
                kLeastConfidence);
  for (size_t run = 0; run < request.runs.size(); ++run) {
    const char* name = request.runs[run].c_str();
    if (std::ranges::count(read.never_confirmed, run) > 0)
      std::printf("not confirmed    %s teaches nothing: its place was told, and nothing on its way confirmed it\n",
                  name);
    else if (std::ranges::none_of(read.placed, [run](const SurveySighting& seen) { return seen.run == run; }))
      std::printf("nothing seen     %s has no sighting with a place on the map\n", name);
  }
  std::printf("errors           %.2f of their sigmas (rms)\n", survey.spread);
}

std::string named(const track::Landmark& mark) {
  std::array<char, 32> at{};
  std::snprintf(at.data(), at.size(), " at %u:%.1f", mark.edge, mark.offset_m);
  const std::string name = mark.name.empty() ? "" : " " + mark.name;
  return track::to_string(mark.kind) + " " + std::to_string(mark.id) + name + at.data();
}

/// What the map and the runs do not agree in.
void print_contradictions(const track::Map& map, const ReadSightings& read, const LearnRequest& request,
                          const Survey& survey) {
  for (const SurveyedLandmark& found : survey.landmarks) {
    if (found.runs_apart == 0) continue;
    const bool taken = found.runs_apart >= request.options.least_runs;
    std::printf("elsewhere        %s: %zu of %zu runs see it %+.2f m from there; %s\n",
                named(map.landmarks[found.known_id - 1]).c_str(), found.runs_apart, found.runs, found.apart_m,
                taken ? "taken, with a sigma that holds both" : "too few, it stays");
  }
  constexpr size_t kMostTold = 20;
  const auto unseen = unseen_landmarks(map, survey, read.placed, read.passed, request.options.least_runs);
  for (size_t i = 0; i < std::min(unseen.size(), kMostTold); ++i)
    std::printf("not seen         %s: by none of the %zu runs that passed it; it stays\n",
                named(*unseen[i].known).c_str(), unseen[i].runs);
  if (unseen.size() > kMostTold) std::printf("not seen         and %zu more\n", unseen.size() - kMostTold);
}

void print_landmarks(const Survey& survey) {
  std::puts("");
  std::printf("%-10s %6s %12s %9s %9s %5s %9s  %s\n", "kind", "edge", "offset [m]", "sigma [m]", "moved [m]", "runs",
              "sightings", "on the map as");
  for (const SurveyedLandmark& found : survey.landmarks) {
    const track::Landmark& mark = found.landmark;
    std::printf("%-10s %6u %12.3f %9.3f %9.3f %5zu %9zu  %s\n", track::to_string(mark.kind).c_str(), mark.edge,
                mark.offset_m, mark.sigma_m, found.moved_m, found.runs, found.sightings,
                found.known_id != 0 ? (std::to_string(found.known_id) + " " + mark.name).c_str() : "new");
  }
}

int learn(const LearnRequest& request) {
  std::vector<std::filesystem::path> inputs(request.runs.begin(), request.runs.end());
  inputs.emplace_back(request.map);
  check_output("--out", request.out, inputs);
  const auto map = std::make_shared<const track::Map>(core::value_or_throw(track::Map::load(request.map)));
  const ReadSightings read = core::value_or_throw(read_runs(map, {request.runs.begin(), request.runs.end()}));
  const Survey survey = survey_landmarks(*map, read.placed, request.options);
  track::Map updated = *map;
  apply_survey(survey, updated);
  updated.learnt_runs.insert(updated.learnt_runs.end(), read.runs.begin(), read.runs.end());
  core::ok_or_throw(updated.save(request.out));
  say_beside({request.out});
  print_runs(read, request, survey);
  if (known_ones_stay(*map))
    std::printf(
        "known ones       stay: the map has learnt from %zu runs before, and all sightings of a thing err alike; to "
        "better them, learn from all runs at once on the map of before\n",
        map->learnt_runs.size());
  print_contradictions(*map, read, request, survey);
  print_landmarks(survey);
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
