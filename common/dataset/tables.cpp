#include <algorithm>
#include <cmath>
#include <functional>

#include "core/csv_table.hpp"
#include "core/train_limits.hpp"
#include "dataset/dataset.hpp"
#include "dataset/yaml_file.hpp"

namespace railfix::dataset {
namespace {

namespace fs = std::filesystem;
using core::CsvTable;
using core::Result;
using core::Status;

const CsvTable::Names kStampNames = {"timestamp", "timestamp_ns", "stamp_ns"};

Status read_imu(const fs::path& file, std::vector<ImuRow>& rows) {
  CsvTable table(file);
  const size_t stamp = table.required(kStampNames);
  const size_t columns[6] = {table.required({"w_x", "w_RS_S_x"}), table.required({"w_y", "w_RS_S_y"}),
                             table.required({"w_z", "w_RS_S_z"}), table.required({"a_x", "a_RS_S_x"}),
                             table.required({"a_y", "a_RS_S_y"}), table.required({"a_z", "a_RS_S_z"})};
  while (table.next(stamp)) {
    ImuRow row;
    row.stamp_ns = table.stamp_ns();
    for (size_t axis = 0; axis < 3; ++axis) {
      row.rate_rps[axis] = table.finite(columns[axis]);
      row.accel_mps2[axis] = table.finite(columns[axis + 3]);
    }
    rows.push_back(row);
  }
  return table.status();
}

Status read_wheel(const fs::path& folder, Sensors& sensors) {
  CsvTable table(folder / "data.csv");
  const size_t stamp = table.required(kStampNames);
  const size_t pulses = table.required({"pulses"});
  while (table.next(stamp)) {
    const int64_t count = table.integer(pulses);
    sensors.wheel.push_back({table.stamp_ns(), count});
  }
  if (!table.status().ok()) return table.status();
  const auto yaml = YamlFile::load(folder / "sensor.yaml");
  if (!yaml.ok()) return yaml.error();
  const auto scale = yaml.value().number("pulses_per_metre");
  if (!scale.ok()) return scale.error();
  if (scale.value() <= 0) return yaml.value().error("pulses_per_metre", "must be positive");
  sensors.pulses_per_metre = scale.value();
  return {};
}

// Numbers of NMEA's GGA: what is better than a single fix but no RTK is used as one, and what is reckoned, typed in or
// simulated is no position of the train.
int fix_of(int64_t quality, CsvTable& table) {
  constexpr int kFixes[] = {0, 1, 1, 1, 4, 5, 0, 0, 0};
  if (quality >= 0 && quality < std::ssize(kFixes)) return kFixes[quality];
  table.refuse("has a fix (" + std::to_string(quality) +
               ") that is none of 0 (none), 1 (single), 4 (RTK fixed) and 5 (RTK float)");
  return 0;
}

Status read_gnss(const fs::path& file, std::vector<GnssRow>& rows) {
  CsvTable table(file);
  const size_t stamp = table.required(kStampNames);
  const size_t lat = table.required({"lat_deg", "lat"});
  const size_t lon = table.required({"lon_deg", "lon"});
  const auto alt = table.optional({"alt_m", "alt"});
  const auto hdop = table.optional({"hdop"});
  const size_t fix = table.required({"fix"});
  while (table.next(stamp)) {
    GnssRow row;
    row.stamp_ns = table.stamp_ns();
    row.fix = fix_of(table.integer(fix), table);
    row.lat_deg = row.fix == 0 ? table.number_or_nan(lat) : table.finite(lat);
    row.lon_deg = row.fix == 0 ? table.number_or_nan(lon) : table.finite(lon);
    row.alt_m = table.number_or_nan(alt);
    row.hdop = table.number_or_nan(hdop);
    if (row.fix != 0 && (std::abs(row.lat_deg) > 90 || std::abs(row.lon_deg) > 180)) {
      const bool swapped = std::abs(row.lat_deg) <= 180 && std::abs(row.lon_deg) <= 90;
      table.refuse(std::string("has a latitude or longitude that is no place on Earth") +
                   (swapped ? ": they may be swapped" : ""));
    }
    rows.push_back(row);
  }
  return table.status();
}

bool could_run(const TruthRow& from, const TruthRow& to) {
  constexpr double kRoundingM = 100;  // of the table: some hold few digits, or places of GNSS behind a bridge
  const double took_s = (static_cast<double>(to.stamp_ns) - static_cast<double>(from.stamp_ns)) * 1e-9;
  return std::abs(to.distance_m - from.distance_m) <= core::kFastestTrainMps * took_s + kRoundingM;
}

}  // namespace

Result<Sensors> read_sensors(const fs::path& sequence) {
  const fs::path root = fs::is_directory(sequence / "mav0") ? sequence / "mav0" : sequence;
  Sensors sensors;
  if (fs::exists(root / "imu0/data.csv")) {
    if (const Status status = read_imu(root / "imu0/data.csv", sensors.imu); !status.ok()) return status.error();
  }
  if (fs::exists(root / "wheel0/data.csv")) {
    if (const Status status = read_wheel(root / "wheel0", sensors); !status.ok()) return status.error();
  }
  if (fs::exists(root / "gnss0/data.csv")) {
    if (const Status status = read_gnss(root / "gnss0/data.csv", sensors.gnss); !status.ok()) return status.error();
  }
  return sensors;
}

bool has_sensors_alone(const fs::path& sequence) {
  const fs::path root = sequence / "mav0";
  const auto has_table = [&](const char* sensor) { return fs::is_regular_file(root / sensor / "data.csv"); };
  if (has_table("cam0")) {
    auto pictures = core::CsvReader::open(root / "cam0/data.csv");
    if (!pictures.ok() || pictures.value().next() || !pictures.value().status().ok()) return false;
  }
  return has_table("imu0") || has_table("wheel0") || has_table("gnss0");
}

Result<std::vector<TruthRow>> read_truth(const fs::path& track_csv) {
  CsvTable table(track_csv);
  const size_t stamp = table.required(kStampNames);
  const size_t distance = table.required({"distance", "distance_m"});
  using Column = std::pair<std::optional<size_t>, std::function<double&(TruthRow&)>>;
  const Column columns[] = {
      {table.optional({"speed", "speed_mps"}), [](TruthRow& r) -> double& { return r.speed_mps; }},
      {table.optional({"acceleration", "acceleration_mps2"}),
       [](TruthRow& r) -> double& { return r.acceleration_mps2; }},
      {table.optional({"camera_height", "camera_height_m", "height", "height_m"}),
       [](TruthRow& r) -> double& { return r.camera.height_m; }},
      {table.optional({"lateral", "lateral_m"}), [](TruthRow& r) -> double& { return r.camera.lateral_m; }},
      {table.optional({"pitch", "pitch_rad"}), [](TruthRow& r) -> double& { return r.camera.pitch_rad; }},
      {table.optional({"yaw", "yaw_rad"}), [](TruthRow& r) -> double& { return r.camera.yaw_rad; }},
      {table.optional({"roll", "roll_rad"}), [](TruthRow& r) -> double& { return r.camera.roll_rad; }},
      {table.optional({"curvature", "curvature_per_m"}), [](TruthRow& r) -> double& { return r.curvature_per_m; }},
      {table.optional({"vertical_curvature", "vertical_curvature_per_m"}),
       [](TruthRow& r) -> double& { return r.vertical_curvature_per_m; }},
      {table.optional({"easting", "easting_m"}), [](TruthRow& r) -> double& { return r.easting_m; }},
      {table.optional({"northing", "northing_m"}), [](TruthRow& r) -> double& { return r.northing_m; }},
      {table.optional({"heading", "heading_rad"}), [](TruthRow& r) -> double& { return r.heading_rad; }},
  };
  std::vector<TruthRow> rows;
  while (table.next(stamp)) {
    TruthRow row;
    row.stamp_ns = table.stamp_ns();
    row.distance_m = table.finite(distance, core::kFarthestM);
    for (const auto& [column, field] : columns) field(row) = table.number_or_nan(column, core::kFarthestM);
    if (!rows.empty() && !could_run(rows.back(), row))
      table.refuse("has a distance that no train reaches from the one of the row above in this time; correct the row");
    rows.push_back(row);
  }
  if (!table.status().ok()) return table.status().error();
  return rows;
}

Result<std::vector<TruthLandmark>> read_truth_landmarks(const fs::path& landmarks_csv) {
  CsvTable table(landmarks_csv);
  const size_t kind = table.required({"kind"});
  const size_t distance = table.required({"distance", "distance_m"});
  const auto lateral = table.optional({"lateral", "lateral_m"});
  std::vector<TruthLandmark> landmarks;
  while (table.next()) {
    landmarks.push_back({table.text(kind), table.finite(distance), table.number_or_nan(lateral)});
    if (landmarks.back().kind.empty()) table.refuse("has no kind");
  }
  if (!table.status().ok()) return table.status().error();
  return landmarks;
}

Result<std::vector<TruthVisibility>> read_truth_visibility(const fs::path& visibility_csv) {
  CsvTable table(visibility_csv);
  const size_t stamp = table.required({"stamp_ns"});
  const size_t visible = table.required({"rails_visible"});
  std::vector<TruthVisibility> rows;
  while (table.next()) rows.push_back({table.integer(stamp), table.finite(visible)});
  if (!table.status().ok()) return table.status().error();
  return rows;
}

std::optional<fs::path> find_map(const fs::path& sequence) {
  // Compiled maps first, then what `railfix map build` reads, from the richest format to the plainest.
  static const std::vector<std::string> kByPreference = {".rfmap",   ".railmap", ".map", ".pb",  ".railml", ".landxml",
                                                         ".xml",     ".gz",      ".zip", ".bz2", ".pbf",    ".osm",
                                                         ".geojson", ".json",    ".gpx", ".csv"};
  std::optional<fs::path> best;
  size_t best_rank = kByPreference.size();
  std::error_code problem;
  for (const auto& entry : fs::directory_iterator(sequence / "map", problem)) {
    if (!entry.is_regular_file()) continue;
    const auto found = std::find(kByPreference.begin(), kByPreference.end(), entry.path().extension().string());
    const auto rank = static_cast<size_t>(found - kByPreference.begin());
    if (rank < best_rank || (rank == best_rank && best && entry.path() < *best)) {
      best = entry.path();
      best_rank = rank;
    }
  }
  return best;
}

}  // namespace railfix::dataset
