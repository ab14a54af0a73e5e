#include <exception>
#include <iostream>

#include "commands.hpp"
#include "core/result.hpp"

namespace {

constexpr int kWorkFailed = 1;
constexpr int kBadInput = 2;

}  // namespace

int main(int argc, char** argv) {
  using namespace railfix::tool;
  CLI::App app{
      "Railfix: where the train is, from a camera. `railfix COMMAND --help` explains a command with an example."};
  app.set_version_flag("--version", std::string("railfix ") + RAILFIX_VERSION);
  app.require_subcommand(1);
  Action chosen;
  for (const auto add : {add_run, add_simulate, add_evaluate, add_calibrate, add_map, add_top, add_topics, add_log,
                         add_replay, add_recording, add_tell, add_tpr, add_train}) {
    add(app, chosen);
  }
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : kBadInput;
  }
  try {
    return chosen();
  } catch (const railfix::core::BadInput& error) {
    std::cerr << "railfix: " << error.what() << '\n';
    return kBadInput;
  } catch (const std::exception& error) {
    std::cerr << "railfix: the work failed: " << error.what() << '\n';
    return kWorkFailed;
  }
}
