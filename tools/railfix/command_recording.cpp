#include "command_recording.hpp"

namespace railfix::tool {

void add_recording(CLI::App& app, Action& chosen) {
  auto* recording = app.add_subcommand("recording", "Recordings (MCAP files): repair what a crash left behind");
  recording->require_subcommand(1);
  add_recording_repair(*recording, chosen);
}

}  // namespace railfix::tool
