#include "simulator/dataset_writer.hpp"

#include <cmath>
#include <fstream>

#include "core/csv.hpp"
#include "core/time.hpp"
#include "simulator/renderer.hpp"

namespace railfix::simulator {
namespace {

namespace fs = std::filesystem;

constexpr double kEdgeAheadM[] = {4, 5, 6, 7, 8, 10, 12, 15, 18, 22, 27, 33, 40, 50, 60, 80};

core::Status write_number(const fs::path& file, const char* key, double value) {
  std::ofstream stream(file);
  stream << key << ": " << value << '\n';
  stream.close();
  if (!stream) return core::Error{file.string() + " could not be written completely; is the disk full?"};
  return {};
}

core::Status write_imu(const fs::path& file, const std::vector<dataset::ImuRow>& rows) {
  core::CsvWriter csv(file, "#timestamp [ns],w_x [rad/s],w_y [rad/s],w_z [rad/s],a_x [m/s^2],a_y [m/s^2],a_z [m/s^2]");
  for (const auto& row : rows) {
    csv << row.stamp_ns;
    for (const double rate : row.rate_rps) csv << rate;
    for (const double accel : row.accel_mps2) csv << accel;
    csv.end_row();
  }
  return csv.close();
}

}  // namespace

std::string picture_name(int64_t stamp_ns, const std::string& format) {
  return std::to_string(stamp_ns) + "." + format;
}

core::Result<DatasetWriter> DatasetWriter::create(const fs::path& root) {
  std::error_code code;
  if (fs::exists(root, code)) {
    if (!fs::is_directory(root, code)) return core::Error{root.string() + " is a file; name a new folder with --out"};
    if (!fs::is_empty(root, code)) return core::Error{root.string() + " is not empty; remove it or give another --out"};
  }
  for (const char* folder : {"mav0/cam0/data", "mav0/imu0", "mav0/wheel0", "mav0/gnss0", "truth", "map"}) {
    fs::create_directories(root / folder, code);
    if (code) return core::Error{(root / folder).string() + " cannot be made: " + code.message()};
  }
  return DatasetWriter(root);
}

core::Status DatasetWriter::write_camera(const dataset::CameraCalibration& calibration,
                                         const std::vector<Exposure>& exposures, const std::string& format) const {
  const auto status = dataset::write_calibration(root_ / "mav0/cam0/sensor.yaml", calibration);
  if (!status.ok()) return status;
  core::CsvWriter csv(root_ / "mav0/cam0/data.csv", "#timestamp [ns],filename");
  for (const auto& exposure : exposures) {
    if (exposure.dropped) continue;
    csv << exposure.stamp_ns << picture_name(exposure.stamp_ns, format);
    csv.end_row();
  }
  return csv.close();
}

core::Status DatasetWriter::write_sensors(const SensorModel& sensors, const SensorOptions& options) const {
  if (const auto status = write_imu(root_ / "mav0/imu0/data.csv", sensors.imu()); !status.ok()) return status;
  if (const auto status = write_number(root_ / "mav0/imu0/sensor.yaml", "rate_hz", options.imu_hz); !status.ok())
    return status;
  if (const auto status = write_number(root_ / "mav0/wheel0/sensor.yaml", "pulses_per_metre", options.pulses_per_metre);
      !status.ok())
    return status;
  core::CsvWriter wheel(root_ / "mav0/wheel0/data.csv", "#timestamp [ns],pulses");
  for (const auto& row : sensors.wheel()) {
    wheel << row.stamp_ns << row.pulses;
    wheel.end_row();
  }
  if (const auto status = wheel.close(); !status.ok()) return status;
  const auto rows = sensors.gnss();
  std::error_code code;
  if (rows.empty()) {
    fs::remove(root_ / "mav0/gnss0", code);
    return {};
  }
  core::CsvWriter gnss(root_ / "mav0/gnss0/data.csv", "#timestamp [ns],lat_deg,lon_deg,alt_m,hdop,fix");
  for (const auto& row : rows) {
    gnss << row.stamp_ns << row.lat_deg << row.lon_deg << row.alt_m << row.hdop << row.fix;
    gnss.end_row();
  }
  return gnss.close();
}

core::Status DatasetWriter::write_truth(const Trajectory& trajectory, const std::vector<Exposure>& exposures,
                                        const geometry::Intrinsics& camera) const {
  core::CsvWriter track(root_ / "truth/track.csv",
                        "timestamp,distance,speed,acceleration,camera_height,lateral,pitch,yaw,roll,curvature,vertical_"
                        "curvature,easting,northing,heading");
  core::CsvWriter rails(root_ / "truth/rails.csv", "stamp_ns,rail,u_px,v_px");
  for (const auto& exposure : exposures) {
    const int64_t stamp = exposure.stamp_ns;
    const auto row = trajectory.truth(core::seconds(exposure.exposed_ns - trajectory.begin_ns()));
    track << stamp << row.distance_m << row.speed_mps << row.acceleration_mps2 << row.camera.height_m
          << row.camera.lateral_m << row.camera.pitch_rad << row.camera.yaw_rad << row.camera.roll_rad
          << row.curvature_per_m << row.vertical_curvature_per_m << row.easting_m << row.northing_m << row.heading_rad;
    track.end_row();
    if (exposure.dropped) continue;
    for (const int side : {1, -1}) {
      for (const double ahead : kEdgeAheadM) {
        const auto pixel = rail_edge_px(trajectory.line(), row, camera, ahead, side);
        if (!pixel || pixel->x() < 0 || pixel->y() < 0 || pixel->x() > camera.width_px - 1 ||
            pixel->y() > camera.height_px - 1)
          continue;
        rails << stamp << (side > 0 ? "L" : "R") << pixel->x() << pixel->y();
        rails.end_row();
      }
    }
  }
  if (const auto status = track.close(); !status.ok()) return status;
  if (const auto status = rails.close(); !status.ok()) return status;
  core::CsvWriter landmarks(root_ / "truth/landmarks.csv", "kind,distance,lateral");
  for (const auto& thing : trajectory.line().things()) {
    // A balise of the neighbouring track is seen, but it is no landmark of this one.
    if (!thing.own && thing.kind == track::LandmarkKind::balise) continue;
    if (!track::can_be_sighted(thing.kind)) continue;
    landmarks << track::to_string(thing.kind) << thing.distance_m << thing.lateral_m;
    landmarks.end_row();
  }
  return landmarks.close();
}

core::Status DatasetWriter::write_visibility(const std::vector<Exposure>& exposures,
                                             const std::vector<Visibility>& visibilities) const {
  core::CsvWriter csv(root_ / "truth/visibility.csv", "stamp_ns,exposed_ns,sequence,rails_visible,gain");
  for (size_t k = 0; k < exposures.size(); ++k) {
    if (exposures[k].dropped) continue;
    csv << exposures[k].stamp_ns << exposures[k].exposed_ns << static_cast<int64_t>(k) << visibilities[k].rails
        << visibilities[k].gain;
    csv.end_row();
  }
  return csv.close();
}

core::Status DatasetWriter::write_description(const std::string& text) const {
  if (text.empty()) return {};
  const auto file = root_ / "simulation.yaml";
  std::ofstream stream(file);
  stream << text;
  stream.close();
  if (!stream) return core::Error{file.string() + " could not be written completely; is the disk full?"};
  return {};
}

core::Status DatasetWriter::write_trains(const std::vector<OtherTrain>& trains) const {
  if (trains.empty()) return {};
  core::CsvWriter csv(root_ / "truth/trains.csv", "edge,front_m,speed_mps,length_m");
  for (const auto& train : trains) {
    csv << static_cast<int64_t>(train.edge) << train.front_m << train.speed_mps << train.length_m;
    csv.end_row();
  }
  return csv.close();
}

core::Status DatasetWriter::write_map(const track::Map& map) const {
  return map.save(root_ / "map/line.map");
}

std::optional<Eigen::Vector2d> rail_edge_px(const Line& line, const dataset::TruthRow& truth,
                                            const geometry::Intrinsics& camera, double ahead_m, int side) {
  const auto foot = line.path().at(truth.distance_m);
  const double s = truth.distance_m + ahead_m;
  if (s > line.path().end_m()) return std::nullopt;
  const auto there = line.path().at(s);
  const double lateral = side * static_cast<double>(kHalfGaugeM);
  const double de = there.pose.easting_m - foot.pose.easting_m - lateral * std::cos(there.pose.heading_rad);
  const double dn = there.pose.northing_m - foot.pose.northing_m + lateral * std::sin(there.pose.heading_rad);
  const double sin_h = std::sin(foot.pose.heading_rad);
  const double cos_h = std::cos(foot.pose.heading_rad);
  const double x = de * sin_h + dn * cos_h;
  const double y = -de * cos_h + dn * sin_h;
  const double z =
      there.elevation_m - foot.elevation_m - foot.grade * x - (there.cant_m - foot.cant_m) / kRailSpacingM * lateral;
  return geometry::View(camera, truth.camera).project({x, y, z});
}

}  // namespace railfix::simulator
