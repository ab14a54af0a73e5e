// What killed processes leave in the host's shared memory: Fast DDS's files of shared pictures (39 MB a camera), which
// nobody else removes.
#pragma once

#include <filesystem>
#include <vector>

namespace railfix::tool {

/// Files of data sharing in `folder` that no process of this computer has mapped. A process of another user that this
/// one may not look into counts as having mapped all: then there are none.
std::vector<std::filesystem::path> left_behind(const std::filesystem::path& folder = "/dev/shm");

/// Removes those that were left behind at both calls of left_behind(): one that is just being made is not mapped yet.
void remove_left_behind(const std::vector<std::filesystem::path>& before,
                        const std::filesystem::path& folder = "/dev/shm");

}  // namespace railfix::tool
