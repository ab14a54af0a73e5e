// What somebody may have meant who typed a name that does not exist.
#pragma once

#include <string>
#include <vector>

namespace railfix::core {

/// Those of the names that are like the wanted one, the most alike first; at most five.
std::vector<std::string> similar_names(const std::string& wanted, const std::vector<std::string>& names);

/// The end of a sentence that refuses a name: "did you mean a, b?", or "there are: ..." with all of them when none
/// is like it.
std::string did_you_mean(const std::string& wanted, const std::vector<std::string>& names);

}  // namespace railfix::core
