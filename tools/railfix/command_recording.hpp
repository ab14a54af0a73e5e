// The commands below `railfix recording`, one file each.
#pragma once

#include "commands.hpp"

namespace railfix::tool {

void add_recording_info(CLI::App& recording, Action& chosen);
void add_recording_cut(CLI::App& recording, Action& chosen);
void add_recording_merge(CLI::App& recording, Action& chosen);
void add_recording_export(CLI::App& recording, Action& chosen);
void add_recording_repair(CLI::App& recording, Action& chosen);

}  // namespace railfix::tool
