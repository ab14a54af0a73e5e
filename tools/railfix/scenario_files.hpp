// Ready scenarios of `railfix simulate`: the files of deploy/scenarios, by name.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "core/result.hpp"

namespace railfix::tool {

struct ScenarioFile {
  std::string name;
  std::filesystem::path file;
  std::string what;  // first comment of the file
};

/// In the order of their names. Empty where the folder is missing.
std::vector<ScenarioFile> ready_scenarios();
/// A file, or the name of a ready scenario. Fails with the names that there are.
core::Result<std::filesystem::path> find_scenario(const std::string& file_or_name);

}  // namespace railfix::tool
