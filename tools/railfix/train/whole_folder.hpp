// A folder that is replaced whole: whoever reads it, whenever that is, finds all of the old files or all of the new
// ones.
#pragma once

#include <filesystem>

#include "core/result.hpp"

namespace railfix::tool {

/// A folder beside this one with the same files, owners and rights, or an empty one where there is none yet. What an
/// interrupted process has left of one goes. A link is followed.
core::Result<std::filesystem::path> draft_of_folder(const std::filesystem::path& folder);
/// Puts the draft in the folder's place, in one step and on the disk, and removes what was there. A file system that
/// cannot exchange two folders (network, memory cards) needs two steps; draft_of_folder() puts right what is between
/// them.
core::Status replace_folder(const std::filesystem::path& draft, const std::filesystem::path& folder);

/// Waits until everything on this file system is on the disk: what is done next is then never there without it.
void to_disk(const std::filesystem::path& folder);

}  // namespace railfix::tool
