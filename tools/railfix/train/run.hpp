// Runs a program and hears what it says.
#pragma once

#include <string>
#include <vector>

namespace railfix::tool {

struct Ran {
  int exit_code = -1;  // -1: it could not be run, or a signal has ended it
  std::string text;    // all that it said, without the last line end
};

Ran run(const std::vector<std::string>& command);

}  // namespace railfix::tool
