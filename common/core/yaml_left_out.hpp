// What a YAML parser leaves out silently.
#pragma once

#include <string>

#include "core/result.hpp"

namespace railfix::core {

/// Of two values of a key the second, and everything behind the first document: an error that calls the text `name` and
/// gives lines, a sentence for each. Throws YAML::Exception where it is no YAML.
Status check_nothing_left_out(const std::string& text, const std::string& name);

}  // namespace railfix::core
