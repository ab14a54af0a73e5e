#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <filesystem>
#include <iostream>
#include <nlohmann/json.hpp>

#include "commands.hpp"
#include "core/json_text.hpp"
#include "core/result.hpp"
#include "core/whole_file.hpp"
#include "dataset/dataset.hpp"
#include "evaluation/evaluation.hpp"
#include "evaluation/html_report.hpp"
#include "output_file.hpp"
#include "service/yaml_file.hpp"
#include "track/import/build.hpp"

namespace railfix::tool {
namespace {

struct EvaluateOptions {
  std::string truth;
  std::string run;
  std::string json;
  std::string report;
};

/// As the run was told; the front end is at the camera's foot where it was told nothing.
double foot_to_front_m(const std::filesystem::path& run) {
  if (!std::filesystem::exists(run / "run.yaml")) return 0;
  const YAML::Node settings = core::value_or_throw(service::read_yaml(run / "run.yaml", "it is what the run was told"));
  const YAML::Node publisher = settings.IsMap() ? settings["tpr_publisher"] : YAML::Node();
  return publisher && publisher.IsMap() && publisher["foot_to_front_m"] ? publisher["foot_to_front_m"].as<double>(0)
                                                                        : 0;
}

/// What reports are judged on. Without a map that can be read all else is judged, and that they are not is said.
evaluation::ReportGround ground_of(const EvaluateOptions& options, const evaluation::RunTables& run) {
  const auto is_of_place = [](const evaluation::ReportRow& row) { return row.position_known(); };
  if (!run.reports || std::ranges::none_of(*run.reports, is_of_place)) return {};
  const auto file = dataset::find_map(std::filesystem::absolute(options.truth + "/").parent_path().parent_path());
  if (!file) return {};
  evaluation::ReportGround ground{nullptr, foot_to_front_m(options.run)};
  if (auto compiled = track::Map::load(*file); compiled.ok()) {
    ground.map = std::make_shared<const track::Map>(std::move(compiled).value());
  } else if (auto built = track::build_map({*file}, {}); built.ok()) {
    ground.map = std::make_shared<const track::Map>(std::move(built).value().map);
  }
  return ground;
}

int evaluate(const EvaluateOptions& options) {
  if (options.json != "-") check_output("--json", options.json, {options.truth, options.run});
  check_output("--report", options.report, {options.truth, options.run});
  check_different({{"--json", options.json == "-" ? "/dev/stdout" : options.json}, {"--report", options.report}});
  const auto truth = core::value_or_throw(evaluation::Truth::read(options.truth));
  const auto run = core::value_or_throw(evaluation::read_run(options.run));
  core::ok_or_throw(evaluation::check_times(truth, run));
  const auto result = evaluation::evaluate(truth, run, ground_of(options, run));
  if (!options.report.empty()) {
    const auto name = std::filesystem::absolute(options.run + "/").parent_path().filename().string();
    core::ok_or_throw(core::write_whole(options.report, evaluation::html_report(truth, result, name)));
  }
  const std::string json = core::json_text(evaluation::to_json(result), 2) + "\n";
  if (options.json == "-") {
    std::cout << json;
    return 0;
  }
  if (!options.json.empty()) core::ok_or_throw(core::write_whole(options.json, json));
  say_beside({options.report, options.json});
  evaluation::print(result, std::cout);
  return 0;
}

}  // namespace

void add_evaluate(CLI::App& app, Action& chosen) {
  auto* command = app.add_subcommand("evaluate", "Judge a run against the truth of its dataset");
  command->footer("Example: railfix evaluate --truth SEQ/truth --run OUT --json figures.json --report report.html");
  auto options = std::make_shared<EvaluateOptions>();
  command->add_option("--truth", options->truth, "Folder with track.csv and landmarks.csv (SEQ/truth)")->required();
  command->add_option("--run", options->run, "Folder that `railfix run --out` wrote")->required();
  command->add_option("--json", options->json, "Write all figures as JSON to this file, - = standard output alone");
  command->add_option("--report", options->report,
                      "Write a report with plots to this file (HTML), another than that of --json");
  command->callback([options, &chosen] { chosen = [options] { return evaluate(*options); }; });
}

}  // namespace railfix::tool
