// Truth by construction: a train at a constant speed on a track of constant curvature.
#pragma once

#include <cmath>

#include "evaluation/truth.hpp"

namespace railfix::evaluation {

constexpr int64_t kSecond = 1'000'000'000;

struct MadeTruth {
  double speed_mps = 20;
  double heading_rad = 0;
  double curvature_per_m = 0;
  int seconds = 50;
  double first_distance_m = 1000;
  geometry::CameraPose camera = {0.01, 0.08, -0.005, 0.05, 2.4};
  std::optional<std::vector<dataset::TruthLandmark>> landmarks;

  [[nodiscard]] dataset::TruthRow row(double time_s) const {
    dataset::TruthRow row;
    row.stamp_ns = static_cast<int64_t>(std::llround(time_s * 1e9));
    row.distance_m = first_distance_m + speed_mps * time_s;
    row.speed_mps = speed_mps;
    row.camera = camera;
    row.curvature_per_m = curvature_per_m;
    row.easting_m = 5000 + speed_mps * time_s * std::sin(heading_rad);
    row.northing_m = 7000 + speed_mps * time_s * std::cos(heading_rad);
    row.heading_rad = heading_rad;
    return row;
  }
  [[nodiscard]] Truth make() const {
    std::vector<dataset::TruthRow> rows;
    for (int i = 0; i <= seconds * 10; ++i) rows.push_back(row(i / 10.0));
    return {rows, landmarks, dataset::CameraCalibration{intrinsics(), 10, camera}};
  }
  static geometry::Intrinsics intrinsics() { return {1200, 1190, 640, 500, -0.05, 0.01, 1e-4, -1e-4, 1280, 1024}; }
};

}  // namespace railfix::evaluation
