// YAML that people write, in files and on the command line.
#pragma once

#include <yaml-cpp/yaml.h>

#include <filesystem>
#include <string>

#include "core/result.hpp"

namespace railfix::service {

/// Throws YAML::BadFile where the file cannot be read (of a folder YAML::LoadFile() throws what is no YAML::Exception).
YAML::Node load_yaml(const std::filesystem::path& file);

/// An error names the file, and the line or, where it cannot be read, what to do. What the parser would leave out
/// silently is an error, too: of two values of a key the second, and everything behind the first document.
core::Result<YAML::Node> read_yaml(const std::filesystem::path& file, const std::string& remedy);

/// The value in --set section.key=VALUE: the text as it stands, as names of files may look like anything. Only what
/// begins with [, {, " or ' is YAML; throws YAML::Exception where that is none.
YAML::Node value_of_set(const std::string& text);

}  // namespace railfix::service
