// The commands below `railfix recording`, one file each.
#pragma once

#include "commands.hpp"

namespace railfix::tool {

void add_recording_repair(CLI::App& recording, Action& chosen);

}  // namespace railfix::tool
