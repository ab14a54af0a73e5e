// Where a command may write: never over what it was given to read.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace railfix::tool {

/// Throws BadInput, naming the option: the file is one of the inputs or a table, picture or recording in one of them (a
/// dataset, a run), it is a folder, or its folder is not there. What has no name yet is not looked at.
void check_output(const std::string& option, const std::filesystem::path& out,
                  const std::vector<std::filesystem::path>& inputs);

}  // namespace railfix::tool
