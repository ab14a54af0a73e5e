// The commands of `railfix`: add_<name> is in command_<name>.cpp. Each adds itself to the command line and, when it was
// typed, puts what to do into `chosen`. Exit codes: 0 done, 1 the work failed, 2 bad input (core::BadInput).
#pragma once

#include <CLI/CLI.hpp>
#include <functional>

namespace railfix::tool {

using Action = std::function<int()>;

void add_run(CLI::App& app, Action& chosen);
void add_simulate(CLI::App& app, Action& chosen);
void add_evaluate(CLI::App& app, Action& chosen);
void add_calibrate(CLI::App& app, Action& chosen);
void add_calibrate_lens(CLI::App& calibrate, Action& chosen);
void add_map(CLI::App& app, Action& chosen);
void add_map_locate(CLI::App& map, Action& chosen);
void add_log(CLI::App& app, Action& chosen);
void add_top(CLI::App& app, Action& chosen);
void add_topics(CLI::App& app, Action& chosen);
void add_replay(CLI::App& app, Action& chosen);
void add_recording(CLI::App& app, Action& chosen);
void add_tell(CLI::App& app, Action& chosen);
void add_tpr(CLI::App& app, Action& chosen);
void add_train(CLI::App& app, Action& chosen);
void add_doctor(CLI::App& app, Action& chosen);

}  // namespace railfix::tool
