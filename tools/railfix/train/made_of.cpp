#include "train/made_of.hpp"

#include <sstream>

#include "core/joined.hpp"

namespace railfix::tool {
namespace {

std::vector<std::string> differing(const TopicLayouts& one, const TopicLayouts& other) {
  std::vector<std::string> files;
  for (const auto& [file, layout] : one) {
    const auto found = other.find(file);
    if (found != other.end() && found->second != layout) files.push_back(file + ".idl");
  }
  return files;
}

std::string named(const PlannedService& service) {
  return "release " + service.release + " of " + service.name;
}

}  // namespace

TopicLayouts topic_layouts_in(const std::string& said) {
  TopicLayouts layouts;
  std::istringstream lines(said);
  for (std::string line; std::getline(lines, line);) {
    std::istringstream words(line);
    std::string head;
    std::string file;
    std::string layout;
    if (words >> head >> file >> layout && head == "topics") layouts[file] = layout;
  }
  return layouts;
}

std::optional<std::string> misfit(const std::vector<PlannedService>& those, const std::vector<PlannedService>& others) {
  for (const auto& one : those) {
    for (const auto& other : others) {
      const auto files = differing(one.made_of, other.made_of);
      if (!files.empty())
        return named(one) + " was made of other topics (" + core::joined(files) + ") than " + named(other);
    }
  }
  return std::nullopt;
}

}  // namespace railfix::tool
