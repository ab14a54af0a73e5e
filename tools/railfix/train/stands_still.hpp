// What the kernel says of a process. Tells one that hangs from one that is busy or waits for a busy computer; in a
// container, too.
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace railfix::tool {

/// All that run now, as far as this one may see them.
std::vector<pid_t> processes();

/// At this moment none of its threads runs, waits for a processor or waits for a disk (proc(5),
/// /proc/PID/task/TID/stat, field 3). False when there is no such process.
bool stands_still(pid_t pid);

/// A process that has this file open, wherever it sees it; 0 = none, or this user may not know.
pid_t holder_of(const std::filesystem::path& file);

/// When this process began (clock ticks since the computer did), which tells it from a later one of the same number;
/// 0 = there is none, or it has ended and waits for its parent.
int64_t born_of(pid_t pid);

/// 0 = there is none.
pid_t parent_of(pid_t pid);

/// Its command line; empty = there is none.
std::vector<std::string> command_of(pid_t pid);

}  // namespace railfix::tool
