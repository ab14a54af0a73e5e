// A small YAML file whose every error names file and key. Used by the readers of this folder only.
#pragma once

#include <yaml-cpp/yaml.h>

#include <filesystem>
#include <string>
#include <vector>

#include "core/result.hpp"

namespace railfix::dataset {

class YamlFile {
 public:
  /// The file must hold a map. The "%YAML:1.0" line that OpenCV writes is accepted.
  static core::Result<YamlFile> load(const std::filesystem::path& file);

  [[nodiscard]] bool has(const std::string& key) const;  // "mount.height_m": a dot goes into a section
  /// Finite numbers only.
  [[nodiscard]] core::Result<double> number(const std::string& key) const;
  [[nodiscard]] core::Result<std::vector<double>> numbers(const std::string& key, size_t at_least) const;
  [[nodiscard]] core::Result<std::string> text(const std::string& key) const;
  /// "FILE key 'KEY': WHAT"
  [[nodiscard]] core::Error error(const std::string& key, const std::string& what) const;

 private:
  [[nodiscard]] YAML::Node find(const std::string& key) const;
  std::filesystem::path file_;
  YAML::Node root_;
};

}  // namespace railfix::dataset
