// Which kind of XML a file is, without reading it whole.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace railfix::track {

/// The first element of a file. Where none can be read the name is empty, and values hold the file's first part, so
/// that the reader of what it seems to be says what is wrong.
struct XmlRoot {
  std::string name;
  std::vector<std::string> values;  // of its attributes, namespaces too
};
XmlRoot xml_root(const std::filesystem::path& file);

}  // namespace railfix::track
