// The track detector alone on simulated datasets with truth: one line a dataset with what was seen, what was wrong, how
// far edges are off and the time; with --poses also pose and curvature errors and the honesty of the sigmas.
//   railfix-bench-rails-on-dataset SEQ... [--poses] [--imu] [--draw DIR EVERY]
//
// A picture counts as visible when both heads stand out from the ground on both sides by 6 grey levels at most of the
// true places, whatever the detector says. It is wrong when "seen" is said and a rail is drawn more than 0.5 m away
// from its true place anywhere nearer than 30 m and than the end that the detector gives, or its points are more than 5
// px off in the median. For --poses the suspension limits are the scatter of the true poses (a floor keeps them from
// zero), as an operator who knows his train would set them, and the rails' offset is zero, as the simulator's gauge is
// exact. --imu: the roll's prior comes from the dataset's gyro. When the mount is found to be off it is said, as
// track_detector says it.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <filesystem>
#include <map>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <string>
#include <vector>

#include "core/time.hpp"
#include "dataset/dataset.hpp"
#include "measuring_tool.hpp"
#include "rails_on_dataset/true_rails.hpp"
#include "track_detector/draw.hpp"
#include "track_detector/imu_roll.hpp"
#include "track_detector/mount_watch.hpp"
#include "track_detector/track_detector.hpp"
#include "whole_number.hpp"

namespace {

using namespace railfix;
using namespace railfix::track_detector;

double quantile(std::vector<double> values, double q) {
  if (values.empty()) return std::nan("");
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(q * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

constexpr double kLeastContrast = 6;
constexpr double kWrongPx = 5;
constexpr double kWrongM = 0.5;

struct Statistics {
  int frames = 0;
  int visible = 0;
  int seen = 0;
  int seen_of_visible = 0;
  int wrong = 0;
  std::array<std::vector<double>, 7> errors;
  std::array<std::vector<double>, 7> normalised;
  std::vector<double> edges;    // distances from the true edge, px
  std::vector<double> outward;  // the same with sign
  std::vector<double> milliseconds;
};

/// How far outward of the true edges the found points are, in pixels along the row.
std::vector<double> outward_errors(const TrackObservation& observation, const bench::TrueRails& truth) {
  std::vector<double> errors;
  for (const auto& point : observation.points) {
    const auto column = bench::true_column(truth.side(point.side), point.pixel.y());
    if (column) errors.push_back((point.side == Side::left ? 1 : -1) * (*column - point.pixel.x()));
  }
  return errors;
}

/// Largest distance on the ground of the drawn rails from the true ones.
double worst_offset_m(const geometry::Intrinsics& camera, const TrackObservation& observation,
                      const bench::TrueRails& truth, double gauge_m) {
  const geometry::View view(camera, observation.shape.camera);
  double worst = 0;
  for (const auto side : {Side::left, Side::right}) {
    for (const auto& pixel : truth.side(side)) {
      const auto ground = view.on_plane(pixel, 0);
      if (!ground || ground->x() > std::min(30.0, observation.far_m)) continue;
      worst = std::max(worst, std::abs(ground->y() - rail_point(observation.shape, side, gauge_m, ground->x()).y()));
    }
  }
  return worst;
}

void compare(const TrackObservation& observation, const dataset::TruthRow& truth, Statistics& statistics) {
  TrackShape shape;
  shape.camera = truth.camera;
  shape.curvature_per_m = truth.curvature_per_m;
  shape.vertical_curvature_per_m = truth.vertical_curvature_per_m;
  const auto error = to_vector(observation.shape) - to_vector(shape);
  for (int k = 0; k < 7; ++k) {
    const auto i = static_cast<size_t>(k);
    statistics.errors[i].push_back(error(k));
    statistics.normalised[i].push_back(error(k) / std::sqrt(std::max(1e-30, observation.covariance(k, k))));
  }
}

void print_line(const std::string& name, const Statistics& s) {
  std::printf("%-28s %6d %8d %8.2f %6d %8.3f %8.2f %8.3f %8.2f %8.2f %8.2f\n", name.c_str(), s.frames, s.visible,
              100.0 * s.seen_of_visible / std::max(1, s.visible), s.wrong, quantile(s.edges, 0.5),
              quantile(s.edges, 0.95), quantile(s.outward, 0.5), quantile(s.milliseconds, 0.5),
              quantile(s.milliseconds, 0.99), quantile(s.milliseconds, 1.0));
}

void print_poses(const Statistics& s) {
  const char* names[] = {"roll mrad", "pitch mrad",    "yaw mrad",          "lateral mm",
                         "height mm", "curvature /km", "vertical curv. /km"};
  std::printf("  %-20s %9s %9s %9s %12s\n", "", "mean", "rms", "max", "rms / sigma");
  for (size_t k = 0; k < 7; ++k) {
    double sum = 0;
    double squares = 0;
    double ratio = 0;
    double largest = 0;
    for (size_t i = 0; i < s.errors[k].size(); ++i) {
      const double e = 1e3 * s.errors[k][i];
      sum += e;
      squares += e * e;
      largest = std::max(largest, std::abs(e));
      ratio += s.normalised[k][i] * s.normalised[k][i];
    }
    const double n = std::max<double>(1, static_cast<double>(s.errors[k].size()));
    std::printf("  %-20s %9.3f %9.3f %9.3f %12.2f\n", names[k], sum / n, std::sqrt(squares / n), largest,
                std::sqrt(ratio / n));
  }
}

/// Scatter of the true poses about the mount.
TrackShapeSigma limits_of(const std::map<int64_t, dataset::TruthRow>& truth, const geometry::CameraPose& mount,
                          TrackShapeSigma limits) {
  Eigen::Matrix<double, 5, 1> squares = Eigen::Matrix<double, 5, 1>::Zero();
  TrackShape middle;
  middle.camera = mount;
  for (const auto& [stamp, row] : truth) {
    TrackShape shape;
    shape.camera = row.camera;
    squares += (to_vector(shape) - to_vector(middle)).head<5>().cwiseAbs2();
  }
  const Eigen::Matrix<double, 5, 1> sigma =
      (squares / static_cast<double>(std::max<size_t>(1, truth.size()))).cwiseSqrt().cwiseMax(1e-4);
  limits.roll_rad = sigma(0);
  limits.pitch_rad = sigma(1);
  limits.yaw_rad = sigma(2);
  limits.lateral_m = std::max(1e-3, sigma(3));
  limits.height_m = std::max(1e-3, sigma(4));
  return limits;
}

struct Options {
  std::string draw_folder;
  int draw_every = 100;
  bool poses = false;
  bool imu = false;
};

void count(const geometry::Intrinsics& camera, const cv::Mat& grey, const TrackObservation& observation,
           const bench::TrueRails& truth, double gauge_m, Statistics& statistics) {
  const bool visible =
      bench::shows(grey, truth, Side::left, kLeastContrast) && bench::shows(grey, truth, Side::right, kLeastContrast);
  statistics.visible += visible ? 1 : 0;
  if (!observation.seen()) return;
  ++statistics.seen;
  statistics.seen_of_visible += visible ? 1 : 0;
  auto errors = outward_errors(observation, truth);
  statistics.outward.insert(statistics.outward.end(), errors.begin(), errors.end());
  for (auto& error : errors) error = std::abs(error);
  statistics.edges.insert(statistics.edges.end(), errors.begin(), errors.end());
  if (quantile(errors, 0.5) > kWrongPx || worst_offset_m(camera, observation, truth, gauge_m) > kWrongM) {
    ++statistics.wrong;
    std::printf("  picture %d is wrong: %.1f px, %.2f m, confidence %.2f\n", statistics.frames, quantile(errors, 0.5),
                worst_offset_m(camera, observation, truth, gauge_m), observation.confidence);
  }
}

void measure_sequence(const std::string& sequence, const Options& wanted) {
  const auto calibration = core::value_or_throw(dataset::read_calibration(sequence + "/mav0/cam0/sensor.yaml"));
  if (!calibration.mount) throw core::BadInput(sequence + " has no mount");
  std::map<int64_t, dataset::TruthRow> truth;
  for (const auto& row : core::value_or_throw(dataset::read_truth(sequence + "/truth/track.csv")))
    truth[row.stamp_ns] = row;
  const auto rails = bench::read_true_rails(sequence + "/truth/rails.csv");
  auto pictures = core::value_or_throw(dataset::open_pictures(sequence, {}));
  DetectorOptions options;
  if (wanted.poses) {
    options.limits = limits_of(truth, *calibration.mount, options.limits);
    options.rail_offset_sigma_m = 0;
  }
  TrackDetector detector(calibration.intrinsics, *calibration.mount, options);
  ImuRollOptions imu_options;
  if (wanted.poses) imu_options.slow_rad = 0;  // the simulator's train has none
  ImuRoll imu_roll(imu_options, *calibration.mount, options.limits.roll_rad);
  const auto imu =
      wanted.imu ? core::value_or_throw(dataset::read_sensors(sequence)).imu : std::vector<dataset::ImuRow>{};
  auto sample = imu.begin();
  MountWatch watch(detector.mount(), options.limits);
  std::string drift;
  int64_t first_ns = 0;
  int64_t last_ns = 0;
  Statistics statistics;
  for (;;) {
    const auto picture = core::value_or_throw(pictures->next());
    if (!picture) break;
    for (; sample != imu.end() && sample->stamp_ns <= picture->stamp_ns; ++sample)
      imu_roll.add(sample->stamp_ns, sample->rate_rps[0]);
    const auto begun = std::clock();
    const auto observation = detector.detect(picture->grey, imu_roll.at(picture->stamp_ns));
    statistics.milliseconds.push_back(1e3 * static_cast<double>(std::clock() - begun) / CLOCKS_PER_SEC);
    ++statistics.frames;
    if (first_ns == 0) first_ns = last_ns = picture->stamp_ns;
    if (observation.seen())
      watch.add(observation.shape, std::sqrt(observation.covariance(5, 5)), core::seconds(picture->stamp_ns - last_ns));
    last_ns = picture->stamp_ns;
    if (drift.empty() && watch.drifted()) {
      drift = watch.what_drifted();
      std::printf("  the mount is off after %.1f s: %s\n", core::seconds(last_ns - first_ns), drift.c_str());
    }
    if (!wanted.draw_folder.empty() && (statistics.frames % wanted.draw_every == 1 || !observation.seen())) {
      cv::Mat colour;
      cv::cvtColor(picture->grey, colour, cv::COLOR_GRAY2BGR);
      draw_track(colour, calibration.intrinsics, observation, options.gauge_m);
      cv::imwrite(wanted.draw_folder + "/" + std::filesystem::path(sequence).filename().string() + "-" +
                      std::to_string(statistics.frames) + ".png",
                  colour);
    }
    const auto true_rails = rails.find(picture->stamp_ns);
    if (true_rails != rails.end())
      count(calibration.intrinsics, picture->grey, observation, true_rails->second, options.gauge_m, statistics);
    const auto row = truth.find(picture->stamp_ns);
    if (observation.seen() && row != truth.end()) compare(observation, row->second, statistics);
  }
  print_line(std::filesystem::path(sequence).filename().string(), statistics);
  if (wanted.poses) print_poses(statistics);
}

}  // namespace

int main(int argc, char** argv) {
  cv::setNumThreads(1);
  std::vector<std::string> sequences;
  std::pair<std::string, std::string> draw;
  Options options;
  CLI::App app("The track detector alone on simulated datasets with truth", "railfix-bench-rails-on-dataset");
  app.add_option("SEQ", sequences, "Dataset folders with truth")->required();
  app.add_flag("--poses", options.poses, "Pose and curvature errors too, and the honesty of the sigmas");
  app.add_flag("--imu", options.imu, "The roll's prior comes from the dataset's gyro");
  app.add_option("--draw", draw, "Folder to draw into, and every how many pictures (DIR EVERY)");
  return measure::run_tool(app, argc, argv, [&] {
    if (!draw.first.empty()) {
      const auto wrong = tool::whole_number(1, 1'000'000)(draw.second);
      if (!wrong.empty()) throw core::BadInput("--draw DIR EVERY: " + wrong);
      options.draw_folder = draw.first;
      options.draw_every = std::max(2, std::stoi(draw.second));
    }
    std::printf("%-28s %6s %8s %8s %6s %8s %8s %8s %8s %8s %8s\n", "dataset", "frames", "visible", "seen %", "wrong",
                "edge px", "p95 px", "outward", "ms", "p99 ms", "max ms");
    for (const auto& sequence : sequences) measure_sequence(sequence, options);
    return 0;
  });
}
