// A file as one text: read whole, or written so that others may read it at any time.
#pragma once

#include <cstddef>
#include <filesystem>
#include <istream>
#include <span>
#include <string>

#include "core/result.hpp"

namespace railfix::core {

/// The sentence for a file that cannot be read, with the system's reason. REQUIRES: errno says it.
Error cannot_read(const std::string& name);

/// An error names the file.
Result<std::string> read_whole(const std::filesystem::path& file);
/// What is left of it; an error calls it `name`.
Result<std::string> read_whole(std::istream& stream, const std::string& name);

/// The same for one that cannot be written, with what to do about that reason.
Error cannot_write(const std::string& name);
/// Waits for a reader. False: errno says why it is not all there.
[[nodiscard]] bool write_all(int descriptor, std::span<const std::byte> bytes);

/// Writes beside the file's place and moves it there, so that nobody ever reads half of it, and of two processes that
/// write it at once one wins; owner and rights stay. A link stays and its target is written. An error names the file,
/// and what was there is as it was; but where the folder takes no other file beside it, it is written in its place.
/// What is no regular file (a pipe, a device) or is open already (/dev/stdout, /dev/fd/N) is written into as it is, and
/// waited for; who reads a named pipe must come within 5 s. Does not wait for the disk: it is for run loops, too.
Status write_whole(const std::filesystem::path& file, const std::string& bytes);
/// The same, with the folders that it lies in.
Status write_whole_with_folders(const std::filesystem::path& file, const std::string& bytes);

/// For a library that writes a file by its name and piece by piece: an empty one beside that place, with the owner and
/// rights of what is there; its name ends in `ending`. Error: as above, and where it is no regular file or the folder
/// takes no other one.
Result<std::filesystem::path> draft_beside(const std::filesystem::path& file, const std::string& ending);
/// Moves it to that place. An error names the file, and both are as they were.
Status move_draft(const std::filesystem::path& draft, const std::filesystem::path& file);

}  // namespace railfix::core
