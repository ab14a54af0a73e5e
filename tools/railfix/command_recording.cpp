#include "command_recording.hpp"

namespace railfix::tool {

void add_recording(CLI::App& app, Action& chosen) {
  auto* recording =
      app.add_subcommand("recording", "Recordings (MCAP files): look into them, cut, join, export, repair");
  recording->footer("Example: railfix recording info run.mcap");
  recording->require_subcommand(1);
  add_recording_info(*recording, chosen);
  add_recording_cut(*recording, chosen);
  add_recording_merge(*recording, chosen);
  add_recording_export(*recording, chosen);
  add_recording_repair(*recording, chosen);
}

}  // namespace railfix::tool
