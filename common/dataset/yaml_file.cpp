#include "dataset/yaml_file.hpp"

#include <cmath>
#include <fstream>
#include <sstream>

#include "core/yaml_left_out.hpp"

namespace railfix::dataset {

using core::Error;
using core::Result;

Result<YamlFile> YamlFile::load(const std::filesystem::path& file) {
  std::ifstream stream(file);
  if (!stream || std::filesystem::is_directory(file)) {
    return Error{file.string() + " cannot be opened; check that the file exists and may be read"};
  }
  std::ostringstream content;
  std::string line;
  while (std::getline(stream, line)) content << (line.starts_with("%YAML") ? "" : line) << '\n';
  YamlFile yaml;
  yaml.file_ = file;
  try {
    yaml.root_ = YAML::Load(content.str());
    if (const auto whole = core::check_nothing_left_out(content.str(), file.string()); !whole.ok())
      return whole.error();
  } catch (const YAML::Exception& problem) {
    return Error{file.string() + " line " + std::to_string(problem.mark.line + 1) + ": is not YAML: " + problem.msg};
  }
  if (!yaml.root_.IsMap()) return Error{file.string() + " holds no 'key: value' lines; it must be a sensor.yaml"};
  return yaml;
}

YAML::Node YamlFile::find(const std::string& key) const {
  // reset() rebinds; operator= would write into the document.
  YAML::Node node;
  node.reset(root_);
  size_t begin = 0;
  while (node.IsMap()) {
    const size_t dot = key.find('.', begin);
    const YAML::Node& parent = node;  // const look-up does not add the key
    const YAML::Node child = parent[key.substr(begin, dot == std::string::npos ? dot : dot - begin)];
    if (!child.IsDefined()) return YAML::Node(YAML::NodeType::Undefined);
    if (dot == std::string::npos) return child;
    node.reset(child);
    begin = dot + 1;
  }
  return YAML::Node(YAML::NodeType::Undefined);
}

bool YamlFile::has(const std::string& key) const {
  const YAML::Node node = find(key);
  return node.IsDefined() && !node.IsNull();
}

Result<double> YamlFile::number(const std::string& key) const {
  if (!has(key)) return error(key, "is missing");
  try {
    const auto value = find(key).as<double>();
    if (std::isfinite(value)) return value;
  } catch (const YAML::Exception&) {
  }
  return error(key, "must be a finite number");
}

Result<std::vector<double>> YamlFile::numbers(const std::string& key, size_t at_least) const {
  if (!has(key)) return error(key, "is missing");
  const std::string wanted = "must be a list of at least " + std::to_string(at_least) + " finite numbers";
  try {
    const auto values = find(key).as<std::vector<double>>();
    for (const double value : values) {
      if (!std::isfinite(value)) return error(key, wanted);
    }
    if (values.size() >= at_least) return values;
  } catch (const YAML::Exception&) {
  }
  return error(key, wanted);
}

Result<std::string> YamlFile::text(const std::string& key) const {
  if (!has(key)) return error(key, "is missing");
  try {
    return find(key).as<std::string>();
  } catch (const YAML::Exception&) {
    return error(key, "must be a word");
  }
}

Error YamlFile::error(const std::string& key, const std::string& what) const {
  return Error{file_.string() + " key '" + key + "': " + what};
}

}  // namespace railfix::dataset
