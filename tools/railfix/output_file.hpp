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

struct Output {
  std::string option;
  std::filesystem::path file;
};
/// Throws BadInput where two of them are one file, and the second would take the first one's place.
void check_different(const std::vector<Output>& outputs);

bool is_standard_output(const std::filesystem::path& file);

/// Once the files are written: where one of them was standard output itself (/dev/stdout), what the command has to say
/// from now on goes to standard error, so that who reads has the file alone.
void say_beside(const std::vector<std::filesystem::path>& outputs);

}  // namespace railfix::tool
