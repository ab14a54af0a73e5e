// What the main() of every measuring tool does: options by CLI11, one sentence for what is wrong.
#pragma once

#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>

#include "core/result.hpp"

namespace railfix::measure {

/// Ends with 2 where the options or the files are wrong, with 1 where the work failed, else with what `work` says.
template <class Work>
int run_tool(CLI::App& app, int argc, char** argv, Work work) {
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  try {
    return work();
  } catch (const core::BadInput& error) {
    std::fprintf(stderr, "%s: %s\n", app.get_name().c_str(), error.what());
    return 2;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s: the work failed: %s\n", app.get_name().c_str(), error.what());
    return 1;
  }
}

}  // namespace railfix::measure
