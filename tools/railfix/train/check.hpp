// Everything that can be known to go wrong before a train starts.
#pragma once

#include <string>
#include <vector>

#include "train/manifest.hpp"

namespace railfix::tool {

struct Finding {
  bool error = true;  // false: a warning; the train may start
  std::string text;   // what is wrong, where, what to do
};

/// The manifest against itself and the files beside it: placement of services, ports, files, certificates, and every
/// service's own check of its configuration (with the programs in `programs`, skipped and said when they are not
/// there).
std::vector<Finding> check_train(const Manifest& manifest, const std::filesystem::path& programs);

/// This computer as a host: shared memory, socket buffers, clock, disk, interface. With a manifest, for what `host`
/// runs.
std::vector<Finding> check_computer(const Manifest* manifest, const TrainHost* host);

}  // namespace railfix::tool
