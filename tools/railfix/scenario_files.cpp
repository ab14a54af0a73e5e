#include "scenario_files.hpp"

#include <algorithm>
#include <cstdlib>
#include <fstream>

namespace railfix::tool {
namespace {

namespace fs = std::filesystem;

// Of the source that this program was built from, or of the package.
fs::path folder() {
  if (const char* other = std::getenv("RAILFIX_SCENARIOS")) return other;
  return fs::exists(RAILFIX_SCENARIOS_FOLDER) ? RAILFIX_SCENARIOS_FOLDER : "/usr/share/railfix/scenarios";
}

}  // namespace

std::vector<ScenarioFile> ready_scenarios() {
  std::vector<ScenarioFile> scenarios;
  std::error_code missing;
  for (const auto& entry : fs::directory_iterator(folder(), missing)) {
    if (entry.path().extension() != ".yaml") continue;
    std::ifstream stream(entry.path());
    std::string line;
    std::getline(stream, line);
    const auto text = line.find_first_not_of("# ");
    scenarios.push_back(
        {entry.path().stem().string(), entry.path(), text == std::string::npos ? "" : line.substr(text)});
  }
  std::sort(scenarios.begin(), scenarios.end(), [](const auto& a, const auto& b) { return a.name < b.name; });
  return scenarios;
}

core::Result<fs::path> find_scenario(const std::string& file_or_name) {
  if (fs::is_regular_file(file_or_name)) return fs::path(file_or_name);
  std::string names;
  for (const auto& scenario : ready_scenarios()) {
    if (scenario.name == file_or_name) return scenario.file;
    names += (names.empty() ? "" : ", ") + scenario.name;
  }
  return core::Error{"--scenario " + file_or_name + " is neither a file nor one of: " + names + " (in " +
                     folder().string() + ")"};
}

}  // namespace railfix::tool
