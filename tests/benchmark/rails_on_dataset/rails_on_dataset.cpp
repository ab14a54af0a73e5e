// The track detector alone on datasets with truth: pose, curvature and edge errors, honesty of the sigmas, time.
//   railfix-bench-rails-on-dataset SEQ... [--draw DIR EVERY]
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <map>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <string>
#include <vector>

#include "dataset/dataset.hpp"
#include "track_detector/draw.hpp"
#include "track_detector/track_detector.hpp"

namespace {

using namespace railfix;
using namespace railfix::track_detector;

double quantile(std::vector<double> values, double q) {
  if (values.empty()) return std::nan("");
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(q * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

/// Horizontal distance of an edge point from the true edge in its row.
double edge_error(const geometry::View& truth, const TrackShape& shape, const EdgePoint& point, double gauge_m) {
  double near_m = 1.5;
  double far_m = 300;
  Eigen::Vector2d pixel(0, 0);
  for (int i = 0; i < 60; ++i) {
    const double middle = std::sqrt(near_m * far_m);
    const auto projected = truth.project(rail_point(shape, point.side, gauge_m, middle));
    if (!projected) return std::nan("");
    pixel = *projected;
    (pixel.y() > point.pixel.y() ? near_m : far_m) = middle;
  }
  return std::abs(pixel.x() - point.pixel.x());
}

struct Statistics {
  int frames = 0;
  int seen = 0;
  std::array<std::vector<double>, 7> errors;
  std::array<std::vector<double>, 7> normalised;
  std::vector<double> edges;
  std::vector<double> milliseconds;
};

void compare(const geometry::Intrinsics& camera, const TrackObservation& observation, const dataset::TruthRow& truth,
             double gauge_m, Statistics& statistics) {
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
  // In transition curves the truth row's constant curvature holds near the train only.
  const geometry::View view(camera, truth.camera);
  for (const auto& point : observation.points) {
    const auto ground = view.on_plane(point.pixel, 0);
    if (ground && ground->x() < 20) statistics.edges.push_back(edge_error(view, shape, point, gauge_m));
  }
}

void print(const std::string& name, const Statistics& s) {
  std::printf(
      "%s: %d pictures, both rails seen in %.2f %%, edge error median %.3f px, 95 %% %.2f px, CPU median %.2f ms, 99 "
      "%% %.2f ms\n",
      name.c_str(), s.frames, 100.0 * s.seen / std::max(1, s.frames), quantile(s.edges, 0.5), quantile(s.edges, 0.95),
      quantile(s.milliseconds, 0.5), quantile(s.milliseconds, 0.99));
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

void measure(const std::string& sequence, const std::string& draw_folder, int draw_every) {
  const auto calibration = core::value_or_throw(dataset::read_calibration(sequence + "/mav0/cam0/sensor.yaml"));
  if (!calibration.mount) throw core::BadInput(sequence + " has no mount");
  std::map<int64_t, dataset::TruthRow> truth;
  for (const auto& row : core::value_or_throw(dataset::read_truth(sequence + "/truth/track.csv")))
    truth[row.stamp_ns] = row;
  auto pictures = core::value_or_throw(dataset::open_pictures(sequence, {}));
  const DetectorOptions options;
  TrackDetector detector(calibration.intrinsics, *calibration.mount, options);
  Statistics statistics;
  for (;;) {
    const auto picture = core::value_or_throw(pictures->next());
    if (!picture) break;
    const auto begun = std::clock();
    const auto observation = detector.detect(picture->grey);
    statistics.milliseconds.push_back(1e3 * static_cast<double>(std::clock() - begun) / CLOCKS_PER_SEC);
    ++statistics.frames;
    if (!draw_folder.empty() && (statistics.frames % draw_every == 1 || !observation.seen())) {
      cv::Mat colour;
      cv::cvtColor(picture->grey, colour, cv::COLOR_GRAY2BGR);
      draw_track(colour, calibration.intrinsics, observation, options.gauge_m);
      cv::imwrite(draw_folder + "/" + std::to_string(statistics.frames) + ".png", colour);
    }
    if (!observation.seen()) {
      std::printf("%s picture %d: %s\n", sequence.c_str(), statistics.frames, observation.reason.c_str());
      continue;
    }
    ++statistics.seen;
    const auto row = truth.find(picture->stamp_ns);
    if (row != truth.end()) compare(calibration.intrinsics, observation, row->second, options.gauge_m, statistics);
  }
  print(sequence, statistics);
}

}  // namespace

int main(int argc, char** argv) {
  cv::setNumThreads(1);
  std::vector<std::string> sequences;
  std::string draw_folder;
  int draw_every = 100;
  for (int i = 1; i < argc; ++i) {
    if (std::string(argv[i]) == "--draw" && i + 2 < argc) {
      draw_folder = argv[++i];
      draw_every = std::max(2, std::atoi(argv[++i]));
    } else {
      sequences.emplace_back(argv[i]);
    }
  }
  try {
    for (const auto& sequence : sequences) measure(sequence, draw_folder, draw_every);
  } catch (const core::BadInput& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 2;
  }
  if (sequences.empty()) std::printf("skipped: name dataset folders with truth\n");
  return 0;
}
