// What a run needs before it starts: inputs checked, map built, the services' one configuration file written.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "core/result.hpp"
#include "run/folder_lock.hpp"

namespace railfix::tool {

struct RunOptions {
  std::filesystem::path source;   // dataset folder, video file, folder of pictures
  std::filesystem::path camera;   // calibration, empty = the dataset's own
  std::filesystem::path map;      // anything `railfix map build` reads, empty = the dataset's own or none
  std::string start = "unknown";  // EDGE:OFFSET[:+|-]
  std::string pace = "lossless";  // real or lossless
  double fps = 0;
  bool camera_only = false;
  bool record_pictures = true;
  std::filesystem::path out;
  std::filesystem::path state;    // folder of what is kept from trip to trip, empty = nothing
  std::filesystem::path draw;     // folder for annotated pictures, empty = none
  std::filesystem::path config;   // services' settings to begin with, empty = defaults
  std::vector<std::string> sets;  // section.key=value
  int64_t domain = 0;
};

/// Which services have nothing to do without a camera.
bool is_of_camera(const std::string& service);

struct RunPlan {
  std::string train_id;
  std::filesystem::path config;      // written into OUT
  std::filesystem::path map;         // compiled, empty = none
  std::optional<uint64_t> pictures;  // how many there will be
  bool has_camera = true;            // false: the dataset has sensors alone
  bool lossless = true;
  std::unique_ptr<FolderLock> lock;  // of OUT: it is this run's alone
};

/// Makes OUT and locks it, refuses one that holds a run, builds the map into it, writes OUT/run.yaml. Every problem is
/// one sentence.
core::Result<RunPlan> plan_run(const RunOptions& options);

}  // namespace railfix::tool
