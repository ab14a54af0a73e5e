// Brings together what belongs to one picture: the preview, and what the track detector saw in it, which comes a little
// later. Also the curvature that was seen on the last metres. Knows no DDS reader. Times are monotonic: a clock that is
// set must not stop the pictures.
#pragma once

#include <deque>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "geometry/camera.hpp"
#include "idl/camera.h"
#include "idl/track.h"
#include "messaging/messaging.hpp"

namespace railfix::monitor {

class CabWatch {
 public:
  using Preview = std::shared_ptr<const msg::CameraPreview>;
  explicit CabWatch(double picture_hz);

  void calibration(const msg::CameraCalibration& calibration);
  void track(const msg::TrackView& view);
  /// Kept until due, unless one of the same camera was due too short a time ago.
  void picture(const std::string& camera, Preview preview, const messaging::SampleInfo& info);

  struct Due {
    std::string camera;
    Preview preview;
    std::optional<msg::TrackView> track;  // of this picture
  };
  /// Pictures whose track view has come, or will not come any more.
  std::vector<Due> due(int64_t now_ns);
  [[nodiscard]] const geometry::Intrinsics* intrinsics(const std::string& camera) const;
  [[nodiscard]] const msg::TrackView* newest() const { return tracks_.empty() ? nullptr : &tracks_.back(); }

 private:
  struct Waiting {
    Preview preview;
    int64_t since_ns = 0;
  };
  int64_t period_ns_;
  std::map<std::string, geometry::Intrinsics> intrinsics_;
  std::map<std::string, Waiting> waiting_;
  std::map<std::string, int64_t> taken_ns_;
  std::deque<msg::TrackView> tracks_;
};

/// The curvature that the camera saw, over the distance travelled.
class CurvatureTrail {
 public:
  /// Points closer than two metres to the last one are left out.
  void add(double distance_m, double per_m, double sigma_per_m);
  /// [[ahead_m, per_m, sigma], ...] as seen from `distance_m`: behind the train is negative.
  [[nodiscard]] nlohmann::json seen_from(double distance_m) const;
  static constexpr double kLengthM = 400;

 private:
  struct Point {
    double distance_m;
    double per_m;
    double sigma_per_m;
  };
  std::deque<Point> points_;
};

}  // namespace railfix::monitor
