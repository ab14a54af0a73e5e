// Tells a process that hangs from one that is busy or waits for a busy computer.
#pragma once

#include <sys/types.h>

namespace railfix::tool {

/// At this moment none of its threads runs, waits for a processor or waits for a disk (proc(5),
/// /proc/PID/task/TID/stat, field 3). False when there is no such process.
bool stands_still(pid_t pid);

}  // namespace railfix::tool
