// Whether the writers and readers of a profile file will find each other (DDS 1.4, 2.2.3, requested against offered).
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "core/result.hpp"

namespace railfix::messaging {

/// One sentence for each topic whose reader asks for more than its writer offers, with Fast DDS profiles from this file
/// over the compiled-in ones. Error: the file cannot be read as profiles. Loads the profiles into this process.
core::Result<std::vector<std::string>> qos_mismatches(const std::filesystem::path& profiles);

}  // namespace railfix::messaging
