// Which kind of XML a file is, without reading it whole.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace railfix::track {

/// The first element of a file, empty where it has none that can be read.
struct XmlRoot {
  std::string name;
  std::vector<std::string> values;  // of its attributes, namespaces too
};
XmlRoot xml_root(const std::filesystem::path& file);

}  // namespace railfix::track
