// What a supervisor and its services say, in a file that is written for years.
#pragma once

#include <filesystem>

namespace railfix::tool {

/// Opened to be written on at its end, with its folders; a long one is kept as FILE.1 first, and the one before goes.
/// Negative: errno says why.
int open_log(const std::filesystem::path& file);

}  // namespace railfix::tool
