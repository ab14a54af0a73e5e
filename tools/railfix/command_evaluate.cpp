#include <filesystem>
#include <iostream>
#include <nlohmann/json.hpp>

#include "commands.hpp"
#include "core/json_text.hpp"
#include "core/result.hpp"
#include "core/whole_file.hpp"
#include "evaluation/evaluation.hpp"
#include "evaluation/html_report.hpp"
#include "output_file.hpp"

namespace railfix::tool {
namespace {

struct EvaluateOptions {
  std::string truth;
  std::string run;
  std::string json;
  std::string report;
};

int evaluate(const EvaluateOptions& options) {
  if (options.json != "-") check_output("--json", options.json, {options.truth, options.run});
  check_output("--report", options.report, {options.truth, options.run});
  check_different({{"--json", options.json == "-" ? "/dev/stdout" : options.json}, {"--report", options.report}});
  const auto truth = core::value_or_throw(evaluation::Truth::read(options.truth));
  const auto run = core::value_or_throw(evaluation::read_run(options.run));
  core::ok_or_throw(evaluation::check_times(truth, run));
  const auto result = evaluation::evaluate(truth, run);
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
