// A file that others may read at any time.
#pragma once

#include <filesystem>
#include <string>

namespace railfix::core {

/// Writes beside the file's place and moves it there, so that nobody ever reads half of it, and of two processes that
/// write it at once one wins. False: what was there is as it was. Does not wait for the disk: it is for run loops, too.
[[nodiscard]] bool write_whole(const std::filesystem::path& file, const std::string& bytes);

}  // namespace railfix::core
