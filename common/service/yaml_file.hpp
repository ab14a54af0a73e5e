// YAML in a file.
#pragma once

#include <yaml-cpp/yaml.h>

#include <filesystem>

#include "core/whole_file.hpp"

namespace railfix::service {

/// Throws YAML::BadFile where the file cannot be read (of a folder YAML::LoadFile() throws what is no YAML::Exception).
inline YAML::Node load_yaml(const std::filesystem::path& file) {
  const auto text = core::read_whole(file);
  if (!text.ok()) throw YAML::BadFile(file.string());
  return YAML::Load(text.value());
}

}  // namespace railfix::service
