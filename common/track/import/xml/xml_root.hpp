// Which kind of XML a file is, without reading it whole.
#pragma once

#include <filesystem>
#include <string>

namespace railfix::track {

/// The first element of a file, without its prefix: "<name", then the values of its attributes, namespaces too. Where
/// none can be read the file's first part, so that the reader of what it seems to be says what is wrong.
std::string xml_root(const std::filesystem::path& file);

}  // namespace railfix::track
