// YAML in a file.
#pragma once

#include <yaml-cpp/yaml.h>

#include <filesystem>
#include <string>

#include "core/result.hpp"
#include "core/whole_file.hpp"

namespace railfix::service {

/// Throws YAML::BadFile where the file cannot be read (of a folder YAML::LoadFile() throws what is no YAML::Exception).
inline YAML::Node load_yaml(const std::filesystem::path& file) {
  const auto text = core::read_whole(file);
  if (!text.ok()) throw YAML::BadFile(file.string());
  return YAML::Load(text.value());
}

/// An error names the file, and the line or, where it cannot be read, what to do.
inline core::Result<YAML::Node> read_yaml(const std::filesystem::path& file, const std::string& remedy) {
  try {
    return load_yaml(file);
  } catch (const YAML::BadFile&) {
    return core::Error{file.string() + " cannot be opened; " + remedy};
  } catch (const YAML::Exception& error) {
    return core::Error{file.string() + " line " + std::to_string(error.mark.line + 1) +
                       ": not valid YAML: " + error.msg};
  }
}

}  // namespace railfix::service
