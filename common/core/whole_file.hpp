// A file as one text: read whole, or written so that others may read it at any time.
#pragma once

#include <filesystem>
#include <istream>
#include <string>

#include "core/result.hpp"

namespace railfix::core {

/// The sentence for a file that cannot be read, with the system's reason. REQUIRES: errno says it.
Error cannot_read(const std::string& name);

/// An error names the file.
Result<std::string> read_whole(const std::filesystem::path& file);
/// What is left of it; an error calls it `name`.
Result<std::string> read_whole(std::istream& stream, const std::string& name);

/// Writes beside the file's place and moves it there, so that nobody ever reads half of it, and of two processes that
/// write it at once one wins. A link stays and its target is written. False: what was there is as it was, and always so
/// where that is no regular file. Does not wait for the disk: it is for run loops, too.
[[nodiscard]] bool write_whole(const std::filesystem::path& file, const std::string& bytes);

}  // namespace railfix::core
