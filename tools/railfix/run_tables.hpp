// A recording as the tables of a run (docs/dataset.md): one CSV file per kind of result, empty cells = not known.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "core/result.hpp"

namespace railfix::tool {

struct TablesReport {
  uint64_t rows = 0;                  // in all tables
  std::vector<std::string> problems;  // what of the recording could not be read, a sentence each
};

/// Writes track_view, rails, odometry, sightings, position_fix, train_state, train_pose, tpr and status .csv into the
/// folder, each with its header even when the recording has nothing for it. Stamps are in the time of the data; a
/// service's status, which carries the host's time, gets the data time that was due when it came where the recording
/// has a data clock.
core::Result<TablesReport> export_tables(const std::filesystem::path& recording,
                                         const std::filesystem::path& out_folder);

}  // namespace railfix::tool
