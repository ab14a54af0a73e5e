// What the ERJU digital map may say of a track and is not read, because no schema at hand gives its units.
#pragma once

#include <string>
#include <vector>

#include "track/import/xml/xml_source.hpp"

namespace railfix::track {

/// Adds a sentence for each kind that the file has.
void tell_unread(const XmlSource& infra, std::vector<std::string>& problems);

}  // namespace railfix::track
