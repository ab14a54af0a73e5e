#include "service/yaml_file.hpp"

#include <sstream>

#include "core/whole_file.hpp"
#include "core/yaml_left_out.hpp"

namespace railfix::service {
namespace {

// Without places in a text, so that what is wrong with it is not told with a line of the file.
YAML::Node unmarked(const YAML::Node& parsed) {
  if (parsed.IsScalar()) return YAML::Node(parsed.Scalar());
  YAML::Node plain(parsed.Type());
  for (const auto& entry : parsed) {
    if (parsed.IsMap()) {
      plain[entry.first.Scalar()] = unmarked(entry.second);
    } else {
      plain.push_back(unmarked(entry));
    }
  }
  return plain;
}

std::string text_of(const std::filesystem::path& file) {
  auto text = core::read_whole(file);
  if (!text.ok()) throw YAML::BadFile(file.string());
  return std::move(text).value();
}

// The first line that a tab indents, which YAML's own error does not say; 0 = none.
int line_with_tab(const std::string& text) {
  std::istringstream lines(text);
  int number = 0;
  for (std::string line; std::getline(lines, line);) {
    ++number;
    const auto indent = line.substr(0, line.find_first_not_of(" \t"));
    if (indent.size() < line.size() && indent.find('\t') != std::string::npos) return number;
  }
  return 0;
}

}  // namespace

YAML::Node load_yaml(const std::filesystem::path& file) {
  return YAML::Load(text_of(file));
}

core::Result<YAML::Node> read_yaml(const std::filesystem::path& file, const std::string& remedy) {
  std::string text;
  try {
    text = text_of(file);
    auto node = YAML::Load(text);
    if (const auto whole = core::check_nothing_left_out(text, file.string()); !whole.ok()) return whole.error();
    return node;
  } catch (const YAML::BadFile&) {
    return core::Error{file.string() + " cannot be opened; " + remedy};
  } catch (const YAML::Exception& error) {
    if (const int line = line_with_tab(text); line > 0)
      return core::Error{file.string() + " line " + std::to_string(line) +
                         ": a tab is at the beginning; YAML wants spaces there"};
    return core::Error{file.string() + " line " + std::to_string(error.mark.line + 1) +
                       ": not valid YAML: " + error.msg};
  }
}

YAML::Node value_of_set(const std::string& text) {
  if (text.empty()) return {};
  const bool is_yaml = std::string("[{\"'").find(text.front()) != std::string::npos;
  return is_yaml ? unmarked(YAML::Load(text)) : YAML::Node(text);
}

}  // namespace railfix::service
