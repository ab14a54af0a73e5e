// Pictures with truth, one after the other: from a dataset folder, or drawn on the way so that nothing need be stored.
#pragma once

#include <memory>
#include <opencv2/core.hpp>
#include <optional>
#include <string>

#include "dataset/dataset.hpp"
#include "simulator/simulation.hpp"

namespace railfix {

struct Moment {
  cv::Mat grey;
  int64_t stamp_ns = 0;  // as the camera says
  double exposure_s = 0;
  dataset::TruthRow truth;
};

class Scene {
 public:
  virtual ~Scene() = default;
  virtual std::optional<Moment> next() = 0;
  [[nodiscard]] virtual const dataset::CameraCalibration& calibration() const = 0;
};

std::unique_ptr<Scene> open_dataset(const std::string& folder);

/// How the run is gone through.
enum class Way { forward, reverse, there_and_back };

/// What happens to the run, and to pictures between the camera and us.
struct Disturbances {
  Way way = Way::forward;
  double drop_share = 0;       // pictures lost
  double stamp_jitter_s = 0;   // 1 sigma of the stamp against the true time
  double idle_shake = 0;       // of the camera, motors running: 1 = 0.3 mrad and 1 mm, up to 19 Hz; also at rest
  double rest_s = 0;           // the pictures of a stop are shown again and again until it has lasted so long
  bool whole_picture = false;  // with scenery and other trains
};

/// Draws only the own track, 60 m ahead and 1 m to either side, if the whole picture is not asked for: the rest stays
/// grey.
std::unique_ptr<Scene> simulate_track(const simulator::SimulationOptions& options, const Disturbances& disturbances);

}  // namespace railfix
