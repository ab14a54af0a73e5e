// Datasets on disk: the EuRoC/ASL folder with wheel and GNSS, a video file, a folder of pictures, KITTI.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

#include "core/result.hpp"
#include "dataset/calibration.hpp"

namespace railfix::dataset {

struct Picture {
  int64_t stamp_ns = 0;
  std::string name;  // file name or frame number, for messages and drawings
  cv::Mat grey;      // CV_8UC1
  cv::Mat colour{};  // CV_8UC3 (blue, green, red) where PictureOptions::colour asks for it, else empty
};

/// Pictures one after the other, from whatever holds them.
class PictureSource {
 public:
  virtual ~PictureSource() = default;
  /// Nothing at the end. A broken picture is an error that names the file; the next call goes on behind it.
  virtual core::Result<std::optional<Picture>> next() = 0;
  /// Stamp of the picture that next() would give; nothing at the end and where it is not known beforehand.
  [[nodiscard]] virtual std::optional<int64_t> next_stamp_ns() const { return std::nullopt; }
  /// Leaves out that picture, without decoding it where possible. False at the end.
  virtual bool skip() = 0;
  /// How many there are.
  [[nodiscard]] virtual std::optional<size_t> count() const = 0;  // nothing = not known (video)
};

struct PictureOptions {
  double fps = 0;       // of folders and videos; 0 = the video's own times, 30 for a folder
  bool colour = false;  // also fill Picture::colour, for people to look at
};

/// mav0/cam0 of a dataset folder (the path may also end at mav0 or cam0), a KITTI folder, a plain folder of png/jpg/pgm
/// (in name order) or a video file.
core::Result<std::unique_ptr<PictureSource>> open_pictures(const std::filesystem::path& path,
                                                           const PictureOptions& options);

struct ImuRow {
  int64_t stamp_ns = 0;
  double rate_rps[3] = {};
  double accel_mps2[3] = {};
};
struct WheelRow {
  int64_t stamp_ns = 0;
  int64_t pulses = 0;
};
struct GnssRow {
  int64_t stamp_ns = 0;
  double lat_deg = 0;
  double lon_deg = 0;
  double alt_m = 0;
  double hdop = 0;
  int fix = 0;
};

/// The sensor tables of SEQ/mav0, whole in memory (an hour of IMU at 200 Hz is 40 MB). Missing folders give empty
/// tables.
struct Sensors {
  std::vector<ImuRow> imu;
  std::vector<WheelRow> wheel;
  double pulses_per_metre = 0;
  std::vector<GnssRow> gnss;
};
core::Result<Sensors> read_sensors(const std::filesystem::path& sequence);
/// Such tables and no pictures, as `railfix simulate --no-pictures` writes them.
bool has_sensors_alone(const std::filesystem::path& sequence);

struct TruthRow {
  int64_t stamp_ns = 0;
  double distance_m = 0;  // of the camera's foot since the start
  double speed_mps = 0;
  double acceleration_mps2 = 0;
  geometry::CameraPose camera;
  double curvature_per_m = 0;
  double vertical_curvature_per_m = 0;
  double easting_m = 0;
  double northing_m = 0;
  double heading_rad = 0;  // clockwise from grid north
};
struct TruthLandmark {
  std::string kind;
  double distance_m = 0;  // on the same scale as TruthRow::distance_m
  double lateral_m = 0;
};
/// timestamp and distance must be there; what the file has no column or no value for is NaN.
core::Result<std::vector<TruthRow>> read_truth(const std::filesystem::path& track_csv);
core::Result<std::vector<TruthLandmark>> read_truth_landmarks(const std::filesystem::path& landmarks_csv);

/// How much of the own rails each picture shows, 0 to 1.
struct TruthVisibility {
  int64_t stamp_ns = 0;
  double rails_visible = 0;
};
core::Result<std::vector<TruthVisibility>> read_truth_visibility(const std::filesystem::path& visibility_csv);

/// Finds SEQ/map/* that `railfix map build` or `Map::load` can read; nothing when there is none.
std::optional<std::filesystem::path> find_map(const std::filesystem::path& sequence);

}  // namespace railfix::dataset
