#include "evaluation/truth.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

#include "core/time.hpp"
#include "core/units.hpp"
#include "evaluation/statistics.hpp"

namespace railfix::evaluation {

using core::Error;
using dataset::TruthRow;

namespace {

/// Degrees, or an angle that counts from the east, would put every error along the track across it. A train runs either
/// way along its track.
core::Status check_headings(const std::vector<TruthRow>& rows, const std::filesystem::path& file) {
  constexpr double kWayM = 5;
  constexpr double kMostRad = 0.3;
  constexpr size_t kEnough = 10;
  std::vector<double> off_rad;
  for (size_t from = 0, to = 1; to < rows.size(); ++to) {
    const double east_m = rows[to].easting_m - rows[from].easting_m;
    const double north_m = rows[to].northing_m - rows[from].northing_m;
    const double way_m = std::hypot(east_m, north_m);
    if (way_m < kWayM) continue;
    const double heading_rad = rows[from].heading_rad;
    from = to;
    if (!std::isfinite(way_m + heading_rad)) continue;
    const double along = (east_m * std::sin(heading_rad) + north_m * std::cos(heading_rad)) / way_m;
    off_rad.push_back(std::acos(std::min(1.0, std::abs(along))));
  }
  if (off_rad.size() < kEnough) return {};
  const double usual_rad = summarise(off_rad).p50;
  if (usual_rad < kMostRad) return {};
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.2f", usual_rad);
  return Error{file.string() + ": its headings are " + text.data() +
               " rad off the way that easting and northing run, in the median; write them in radians, clockwise from "
               "north"};
}

}  // namespace

core::Result<Truth> Truth::read(const std::filesystem::path& folder) {
  auto rows = dataset::read_truth(folder / "track.csv");
  if (!rows.ok()) return rows.error();
  if (rows.value().size() < 2) return Error{(folder / "track.csv").string() + " needs at least two rows"};
  if (const auto headings = check_headings(rows.value(), folder / "track.csv"); !headings.ok()) return headings.error();
  std::optional<std::vector<dataset::TruthLandmark>> landmarks;
  if (std::filesystem::exists(folder / "landmarks.csv")) {
    auto read = dataset::read_truth_landmarks(folder / "landmarks.csv");
    if (!read.ok()) return read.error();
    landmarks = std::move(read).value();
  }
  const auto calibration =
      dataset::find_calibration(std::filesystem::absolute(folder / "").parent_path().parent_path());
  if (!calibration.ok()) return calibration.error();
  Truth truth(std::move(rows).value(), std::move(landmarks), calibration.value());
  if (std::filesystem::exists(folder / "visibility.csv")) {
    const auto visibility = dataset::read_truth_visibility(folder / "visibility.csv");
    if (!visibility.ok()) return visibility.error();
    truth.set_visibility(visibility.value());
  }
  return truth;
}

std::optional<double> Truth::rails_visible(int64_t stamp_ns) const {
  const auto found = visible_.find(stamp_ns);
  return found == visible_.end() ? std::nullopt : std::optional(found->second);
}

void Truth::set_visibility(const std::vector<dataset::TruthVisibility>& rows) {
  for (const auto& row : rows) visible_[row.stamp_ns] = row.rails_visible;
}

Truth::Truth(std::vector<TruthRow> rows, std::optional<std::vector<dataset::TruthLandmark>> landmarks,
             std::optional<dataset::CameraCalibration> calibration)
    : rows_(std::move(rows)), landmarks_(std::move(landmarks)), calibration_(calibration) {
  longest_step_ns_ = longest_step_ns(stamps_of(rows_));
  for (const TruthRow& row : rows_) {
    if (!std::isfinite(row.curvature_per_m)) continue;
    const double vertical = std::isfinite(row.vertical_curvature_per_m) ? row.vertical_curvature_per_m : 0.0;
    bends_.push_back({row.distance_m, row.curvature_per_m, vertical});
  }
  std::stable_sort(bends_.begin(), bends_.end(),
                   [](const Bend& a, const Bend& b) { return a.distance_m < b.distance_m; });
}

std::optional<TruthRow> Truth::at(int64_t stamp_ns) const {
  if (stamp_ns < rows_.front().stamp_ns || stamp_ns > rows_.back().stamp_ns) return std::nullopt;
  const auto next = std::lower_bound(rows_.begin(), rows_.end(), stamp_ns,
                                     [](const TruthRow& row, int64_t stamp) { return row.stamp_ns < stamp; });
  if (next->stamp_ns == stamp_ns) return *next;
  const TruthRow& a = *(next - 1);
  const TruthRow& b = *next;
  if (is_gap(a.stamp_ns, b.stamp_ns)) return std::nullopt;
  const double share = static_cast<double>(stamp_ns - a.stamp_ns) / static_cast<double>(b.stamp_ns - a.stamp_ns);
  const auto between = [share](double from, double to) { return from + share * (to - from); };
  TruthRow row;
  row.stamp_ns = stamp_ns;
  row.distance_m = between(a.distance_m, b.distance_m);
  row.speed_mps = between(a.speed_mps, b.speed_mps);
  row.acceleration_mps2 = between(a.acceleration_mps2, b.acceleration_mps2);
  row.camera.roll_rad = between(a.camera.roll_rad, b.camera.roll_rad);
  row.camera.pitch_rad = between(a.camera.pitch_rad, b.camera.pitch_rad);
  row.camera.yaw_rad = between(a.camera.yaw_rad, b.camera.yaw_rad);
  row.camera.lateral_m = between(a.camera.lateral_m, b.camera.lateral_m);
  row.camera.height_m = between(a.camera.height_m, b.camera.height_m);
  row.curvature_per_m = between(a.curvature_per_m, b.curvature_per_m);
  row.vertical_curvature_per_m = between(a.vertical_curvature_per_m, b.vertical_curvature_per_m);
  row.easting_m = between(a.easting_m, b.easting_m);
  row.northing_m = between(a.northing_m, b.northing_m);
  row.heading_rad = core::wrap_pi(a.heading_rad + share * core::wrap_pi(b.heading_rad - a.heading_rad));
  return row;
}

double Truth::between_rows_m() const {
  double most_m = 0;
  for (size_t i = 1; i + 1 < rows_.size(); ++i) {
    const TruthRow& a = rows_[i - 1];
    const TruthRow& b = rows_[i + 1];
    if (is_gap(a.stamp_ns, rows_[i].stamp_ns) || is_gap(rows_[i].stamp_ns, b.stamp_ns)) continue;
    const double share =
        static_cast<double>(rows_[i].stamp_ns - a.stamp_ns) / static_cast<double>(b.stamp_ns - a.stamp_ns);
    const double middle_m = a.distance_m + share * (b.distance_m - a.distance_m);
    most_m = std::max(most_m, std::abs(rows_[i].distance_m - middle_m) / 4);
  }
  return most_m;
}

Truth::Bend Truth::bend_at(double distance_m) const {
  if (bends_.empty()) return {distance_m, 0, 0};
  const auto next = std::lower_bound(bends_.begin(), bends_.end(), distance_m,
                                     [](const Bend& bend, double d) { return bend.distance_m < d; });
  if (next == bends_.begin()) return bends_.front();
  if (next == bends_.end()) return bends_.back();
  const Bend& a = *(next - 1);
  const double share = (distance_m - a.distance_m) / (next->distance_m - a.distance_m);
  return {distance_m, a.curvature_per_m + share * (next->curvature_per_m - a.curvature_per_m),
          a.vertical_per_m + share * (next->vertical_per_m - a.vertical_per_m)};
}

std::vector<Truth::Offset> Truth::track_ahead(const TruthRow& train, const std::vector<double>& ahead_m) const {
  std::vector<Offset> offsets;
  Offset slope;
  Offset offset;
  double x = 0;
  for (const double ahead : ahead_m) {
    // Curvature taken constant over each step, at its middle: exact for constant and near enough for changing
    // curvature.
    const double step = ahead - x;
    const Bend bend = bend_at(train.distance_m + x + step / 2);
    offset.y_m += slope.y_m * step + bend.curvature_per_m * step * step / 2;
    offset.z_m += slope.z_m * step + bend.vertical_per_m * step * step / 2;
    slope.y_m += bend.curvature_per_m * step;
    slope.z_m += bend.vertical_per_m * step;
    x = ahead;
    offsets.push_back(offset);
  }
  return offsets;
}

double Truth::travelled_m(const Stretch& stretch) const {
  double sum = 0;
  for (size_t i = 1; i < rows_.size(); ++i) {
    if (stretch.holds(rows_[i - 1].stamp_ns) && stretch.holds(rows_[i].stamp_ns))
      sum += std::abs(rows_[i].distance_m - rows_[i - 1].distance_m);
  }
  return sum;
}

}  // namespace railfix::evaluation
