// The tables of a dataset folder (docs/dataset.md).
#pragma once

#include <filesystem>

#include "core/result.hpp"
#include "simulator/renderer.hpp"
#include "simulator/scenario.hpp"
#include "simulator/sensors.hpp"
#include "simulator/trajectory.hpp"

namespace railfix::simulator {

/// How well a picture shows what it should.
struct Visibility {
  double rails = 0;  // share of the own rails, see Renderer::rails_visible
  double gain = 1;
};

class DatasetWriter {
 public:
  /// Makes the folders. Fails when `root` has something in it.
  static core::Result<DatasetWriter> create(const std::filesystem::path& root);

  [[nodiscard]] std::filesystem::path picture_file(const std::string& name) const {
    return root_ / "mav0/cam0/data" / name;
  }
  /// sensor.yaml and data.csv of the camera.
  [[nodiscard]] core::Status write_camera(const dataset::CameraCalibration& calibration,
                                          const std::vector<Exposure>& exposures, const std::string& format) const;
  [[nodiscard]] core::Status write_sensors(const SensorModel& sensors, const SensorOptions& options) const;
  /// truth/track.csv, one row a picture, dropped ones too: what it shows; truth/rails.csv, exact inner rail edges in
  /// the picture; truth/landmarks.csv.
  [[nodiscard]] core::Status write_truth(const Trajectory& trajectory, const std::vector<Exposure>& exposures,
                                         const geometry::Intrinsics& camera) const;
  /// truth/visibility.csv, one row a picture that was not dropped.
  [[nodiscard]] core::Status write_visibility(const std::vector<Exposure>& exposures,
                                              const std::vector<Visibility>& visibilities) const;
  /// simulation.yaml, with nothing to say no file.
  [[nodiscard]] core::Status write_description(const std::string& text) const;
  /// truth/trains.csv, nothing when there are none.
  [[nodiscard]] core::Status write_trains(const std::vector<OtherTrain>& trains) const;
  [[nodiscard]] core::Status write_map(const track::Map& map) const;

 private:
  explicit DatasetWriter(std::filesystem::path root) : root_(std::move(root)) {}
  std::filesystem::path root_;
};

/// Name of the picture of this time.
std::string picture_name(int64_t stamp_ns, const std::string& format);

/// The inner edge of a rail (left: side = +1, right: -1) `ahead_m` along the track in the picture of this truth.
std::optional<Eigen::Vector2d> rail_edge_px(const Line& line, const dataset::TruthRow& truth,
                                            const geometry::Intrinsics& camera, double ahead_m, int side);

}  // namespace railfix::simulator
