// What `railfix replay` was told.
#pragma once

#include <filesystem>
#include <limits>
#include <map>
#include <string>
#include <vector>

#include "topic_listener.hpp"

namespace railfix::tool {

struct ReplayOptions {
  std::filesystem::path file;
  double rate = 1;
  std::vector<std::string> topics;            // empty = all but those of kOnlyWhenNamed
  std::vector<std::string> without;           // left out
  std::map<std::string, std::string> remaps;  // recorded name -> name now
  TrainNetwork network;
  double from_s = 0;  // into the recording
  double to_s = std::numeric_limits<double>::infinity();
  bool loop = false;
  bool paused = false;                 // begins so
  bool controlled = false;             // waits for commands at the end
  std::vector<std::string> lock_step;  // services that take turns; empty = by the clock
};

}  // namespace railfix::tool
