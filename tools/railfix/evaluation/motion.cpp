#include "evaluation/motion.hpp"

#include <algorithm>
#include <cmath>

#include "core/time.hpp"
#include "track/declared.hpp"

namespace railfix::evaluation {
namespace {

constexpr double kWindowM = 100.0;
constexpr double kWindowStepM = 10.0;

double speed_rms(const std::vector<MotionSample>& samples) {
  std::vector<double> errors;
  errors.reserve(samples.size());
  for (const MotionSample& sample : samples) errors.push_back(sample.speed_mps - sample.true_speed_mps);
  return root_mean_square(errors);
}

template <class Row>
std::vector<MotionSample> beside_truth(const Truth& truth, const std::vector<Row>& rows) {
  std::vector<MotionSample> samples;
  double first_m = 0;
  double first_true_m = 0;
  for (const Row& row : rows) {
    const auto real = truth.at(row.stamp_ns);
    if (!real || !std::isfinite(row.distance_m)) continue;
    if (samples.empty()) {
      first_m = row.distance_m;
      first_true_m = real->distance_m;
    }
    samples.push_back(
        {row.stamp_ns, real->distance_m - first_true_m, row.distance_m - first_m, real->speed_mps, row.speed_mps});
  }
  return samples;
}

void sum_up_interval(PositionResult& result) {
  std::vector<double> widths;
  size_t covered = 0;
  size_t usable = 0;
  size_t usable_intervals = 0;
  size_t usable_covered = 0;
  for (const PositionSample& sample : result.samples) {
    usable += sample.usable ? 1 : 0;
    if (!sample.has_interval()) {
      ++result.without_interval;
      continue;
    }
    widths.push_back(sample.over_m + sample.under_m);
    covered += sample.covered() ? 1 : 0;
    usable_intervals += sample.usable ? 1 : 0;
    usable_covered += sample.usable && sample.covered() ? 1 : 0;
  }
  result.coverage_percent = percent(covered, widths.size());
  result.coverage_usable_percent = percent(usable_covered, usable_intervals);
  result.usable_percent = percent(usable, result.samples.size());
  result.interval_width_m = summarise(std::move(widths));
}

bool declared(const StateRow& row) {
  return row.track_known && !(row.track_probability < track::kDeclaredProbability);
}

void sum_up_errors(PositionResult& result) {
  std::vector<double> along;
  std::vector<double> signed_along;
  std::vector<double> cross;
  for (const PositionSample& sample : result.samples) {
    along.push_back(std::abs(sample.along_m));
    signed_along.push_back(sample.along_m);
    cross.push_back(std::abs(sample.cross_m));
  }
  result.error_m = summarise(along);
  result.bias_m = summarise(signed_along).mean;
  result.cross_m = summarise(cross);
  if (result.cross_m.count == 0) return;
  size_t known = 0;
  size_t own = 0;
  for (const PositionSample& sample : result.samples) {
    if (!sample.track_declared || !std::isfinite(sample.cross_m)) continue;
    ++known;
    own += std::abs(sample.cross_m) < kOwnTrackM ? 1 : 0;
  }
  result.right_percent = percent(own, known);
}

void sum_up_track_choice(const std::vector<StateRow>& rows, PositionResult& result) {
  size_t known = 0;
  for (const StateRow& row : rows) {
    if (!declared(row)) continue;
    if (known++ == 0) result.known_after_s = core::seconds(row.stamp_ns - rows.front().stamp_ns);
  }
  result.known_percent = percent(known, rows.size());
}

PositionSample interval_of(const StateRow& row, double true_distance_m) {
  PositionSample sample;
  sample.stamp_ns = row.stamp_ns;
  sample.true_distance_m = true_distance_m;
  sample.over_m = row.over_m;
  sample.under_m = row.under_m;
  sample.easting_m = row.easting_m;
  sample.northing_m = row.northing_m;
  sample.track_declared = declared(row);
  sample.usable = row.integrity != "unusable";
  return sample;
}

std::vector<PositionSample> on_map(const Truth& truth, const std::vector<StateRow>& rows) {
  std::vector<PositionSample> samples;
  for (const StateRow& row : rows) {
    if (!row.track_known) continue;
    const auto real = truth.at(row.stamp_ns);
    if (!real) continue;
    // Heading is clockwise from north: forward is (sin, cos) in (easting, northing).
    const double east = row.easting_m - real->easting_m;
    const double north = row.northing_m - real->northing_m;
    const double sine = std::sin(real->heading_rad);
    const double cosine = std::cos(real->heading_rad);
    PositionSample sample = interval_of(row, real->distance_m);
    sample.along_m = east * sine + north * cosine;
    sample.cross_m = -east * cosine + north * sine;
    if (std::isfinite(sample.along_m)) samples.push_back(sample);
  }
  return samples;
}

std::vector<PositionSample> by_distance(const Truth& truth, const std::vector<StateRow>& rows) {
  std::vector<PositionSample> samples;
  double first_error_m = 0;
  for (const StateRow& row : rows) {
    const auto real = truth.at(row.stamp_ns);
    if (!real || !std::isfinite(row.distance_m)) continue;
    const double error_m = row.distance_m - real->distance_m;
    if (samples.empty()) first_error_m = error_m;
    PositionSample sample = interval_of(row, real->distance_m);
    sample.along_m = error_m - first_error_m;
    samples.push_back(sample);
  }
  return samples;
}

}  // namespace

bool PositionSample::has_interval() const {
  return std::isfinite(over_m) && std::isfinite(under_m);
}
bool PositionSample::covered() const {
  return along_m <= over_m && -along_m <= under_m;
}

Drift drift_of(const std::vector<MotionSample>& samples) {
  Drift drift;
  if (samples.empty()) return drift;
  std::vector<double> travelled = {0.0};
  for (size_t i = 1; i < samples.size(); ++i) {
    travelled.push_back(travelled.back() + std::abs(samples[i].true_distance_m - samples[i - 1].true_distance_m));
  }
  const auto error_at = [&](size_t i) { return samples[i].distance_m - samples[i].true_distance_m; };
  drift.travelled_m = travelled.back();
  drift.error_m = error_at(samples.size() - 1) - error_at(0);
  if (drift.travelled_m > 0) drift.percent = 100.0 * std::abs(drift.error_m) / drift.travelled_m;

  std::vector<double> windows;
  const auto first_behind = [&](double metres) {
    return static_cast<size_t>(std::lower_bound(travelled.begin(), travelled.end(), metres) - travelled.begin());
  };
  // From each step of the way that a sample lies in: rows may lie far apart.
  for (double from_m = 0;;) {
    const size_t begin = first_behind(from_m);
    if (begin >= samples.size()) break;
    const size_t end = first_behind(travelled[begin] + kWindowM);
    if (end >= samples.size()) break;
    windows.push_back(100.0 * std::abs(error_at(end) - error_at(begin)) / (travelled[end] - travelled[begin]));
    from_m = kWindowStepM * (std::floor(travelled[begin] / kWindowStepM) + 1);
  }
  drift.window_percent = summarise(std::move(windows));
  return drift;
}

OdometryResult judge_odometry(const Truth& truth, const std::vector<OdometryRow>& rows) {
  OdometryResult result;
  result.samples = beside_truth(truth, rows);
  result.drift = drift_of(result.samples);
  result.speed_rms_mps = speed_rms(result.samples);
  result.turn = judge_turn(truth, rows);
  const auto valid = std::count_if(rows.begin(), rows.end(), [](const OdometryRow& row) { return row.valid; });
  const auto blind =
      std::count_if(rows.begin(), rows.end(), [](const OdometryRow& row) { return row.mode == "blind"; });
  result.valid_percent = percent(static_cast<size_t>(valid), rows.size());
  result.blind_percent = percent(static_cast<size_t>(blind), rows.size());
  return result;
}

PositionResult judge_position(const Truth& truth, const std::vector<StateRow>& rows) {
  PositionResult result;
  result.states = rows.size();
  result.beside_truth = static_cast<size_t>(
      std::ranges::count_if(rows, [&](const StateRow& row) { return truth.at(row.stamp_ns).has_value(); }));
  result.motion = beside_truth(truth, rows);
  result.drift = drift_of(result.motion);
  result.speed_rms_mps = speed_rms(result.motion);
  result.samples = on_map(truth, rows);
  result.from_map = !result.samples.empty();
  if (!result.from_map) {
    result.samples = by_distance(truth, rows);
    result.truth_lacks_heading = std::ranges::any_of(truth.rows(), [](const dataset::TruthRow& row) {
      return std::isfinite(row.easting_m + row.northing_m) && !std::isfinite(row.heading_rad);
    });
  }
  sum_up_errors(result);
  sum_up_interval(result);
  sum_up_track_choice(rows, result);
  return result;
}

}  // namespace railfix::evaluation
