// A whole run into a dataset folder: pictures, sensors, truth and map.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <string>

#include "core/result.hpp"
#include "simulator/renderer.hpp"
#include "simulator/scenario.hpp"
#include "simulator/sensors.hpp"
#include "simulator/trajectory.hpp"

namespace railfix::simulator {

struct SimulationOptions {
  std::filesystem::path out;
  std::shared_ptr<const track::Map> map;  // nothing = a built-in line
  std::string line = "default";           // or "long": the built-in line without a map
  std::string start = "1:100";
  std::vector<std::string> via;  // edges to turn to at switches, numbers or names
  RunOptions run;
  ShakeOptions shake;
  SensorOptions sensors;
  RenderOptions render;  // camera set; its seed is `seed`
  geometry::CameraPose mount{0.0, 0.2094, 0.0, 0.0, 2.5};
  double rate_hz = 30.0;
  ScenarioOptions scenario;
  std::string description;  // what is simulated, for SEQ/simulation.yaml
  int other_trains = 0;     // met on the tracks beside the path
  bool pictures = true;
  std::string format = "png";  // png, jpg or pgm
  int jpeg_quality = 95;
  int threads = 1;
  uint64_t seed = 1;
};

struct SimulationReport {
  size_t pictures = 0;
  double duration_s = 0;
  double length_m = 0;
  double render_ms = 0;  // mean time of one picture on one thread, without encoding
};

/// Called with pictures done and their number.
using ProgressCall = std::function<void(size_t done, size_t total)>;

/// Writes the folder as docs/dataset.md says, plus truth/rails.csv (exact inner rail edges of every picture).
/// An existing folder is refused unless it is empty.
core::Result<SimulationReport> simulate(const SimulationOptions& options, const ProgressCall& progress);

}  // namespace railfix::simulator
