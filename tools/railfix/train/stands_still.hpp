// Tells a process that hangs from one that is busy or waits for a busy computer; in a container, too.
#pragma once

#include <sys/types.h>

#include <filesystem>

namespace railfix::tool {

/// At this moment none of its threads runs, waits for a processor or waits for a disk (proc(5),
/// /proc/PID/task/TID/stat, field 3). False when there is no such process.
bool stands_still(pid_t pid);

/// A process that has this file open, wherever it sees it; 0 = none, or this user may not know.
pid_t holder_of(const std::filesystem::path& file);

}  // namespace railfix::tool
