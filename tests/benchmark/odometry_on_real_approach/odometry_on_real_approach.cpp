// What the train mouse measures on a real approach to a stop: ../shared/data/cabview, frames 0118-0134, one a second.
// railfix-bench-odometry-on-real-approach [--draw DIR]
//
// Two scales are checked from the pictures themselves: the focal length, which is a guess, by the sleepers' distance,
// and the needle of speed.csv by the kilometre counter above the needle. Ends with 1 when a step is wrong.
#include <CLI/CLI.hpp>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <string>

#include "needle.hpp"
#include "odometry/train_mouse.hpp"
#include "sleeper_spacing.hpp"
#include "track_detector/track_detector.hpp"

namespace {

namespace fs = std::filesystem;
using namespace railfix;

constexpr int kFirst = 118;
constexpr int kLast = 134;
constexpr double kGuessedFocalPx = 0.72 * 1920;
constexpr double kSleeperM = 0.60;
constexpr double kSleeperSigma = 0.03;  // share: how well the distance of these sleepers is known
constexpr double kTextureDepthM = 0.18;

struct Measured {
  std::map<int, odometry::MouseStep> steps;
  double sleepers_m = 0;
};

struct Run {
  fs::path frames;
  fs::path draw;
  double far_m = 20;  // this camera sees the ground from 8 m on
};

fs::path data_folder() {
  if (const char* folder = std::getenv("RAILFIX_DATA")) return folder;
  return fs::path(RAILFIX_SOURCE_DIR).parent_path() / "shared" / "data";
}

cv::Mat picture_of(const fs::path& frames, int frame) {
  char name[16];
  std::snprintf(name, sizeof name, "%04d.jpg", frame);
  return cv::imread(frames / name, cv::IMREAD_GRAYSCALE);
}

// As odometry_service takes it from track_view.
odometry::MousePicture look(track_detector::TrackDetector& detector, const geometry::CameraPose& mount,
                            const cv::Mat& grey, int frame) {
  const auto seen = detector.detect(grey);
  odometry::MousePicture picture;
  picture.grey = grey;
  picture.stamp_ns = 1'000'000'000LL * frame;
  picture.pose_measured = seen.seen_left || seen.seen_right;
  picture.pose = picture.pose_measured ? seen.shape.camera : mount;
  constexpr int kOf[3] = {1, 4, 6};  // pitch, height, vertical curvature
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) picture.trust.covariance(i, j) = seen.covariance(kOf[i], kOf[j]);
  }
  picture.curvature_per_m = seen.shape.curvature_per_m;
  picture.vertical_curvature_per_m = seen.shape.vertical_curvature_per_m;
  return picture;
}

// What both pictures see of the ground, far to the right: the picture, both laid over each other by the measured step
// (red and cyan where they differ), the picture before.
void draw_overlay(const fs::path& folder, int frame, const cv::Mat& before, const cv::Mat& now, double step_m,
                  double cell_m) {
  const int shift = static_cast<int>(std::lround(step_m / cell_m));
  if (shift <= 0 || shift + 10 > now.rows) return;
  cv::Mat grey[2];
  const double mean = cv::mean(now)[0];
  const double gain = 100.0 / mean;
  now.rowRange(0, now.rows - shift).convertTo(grey[0], CV_8U, gain);
  before.rowRange(shift, before.rows).convertTo(grey[1], CV_8U, gain);
  cv::Mat strips[3];
  cv::cvtColor(grey[0], strips[0], cv::COLOR_GRAY2BGR);
  cv::merge(std::vector<cv::Mat>{grey[0], grey[0], grey[1]}, strips[1]);
  cv::cvtColor(grey[1], strips[2], cv::COLOR_GRAY2BGR);
  cv::Mat picture;
  cv::hconcat(strips, 3, picture);
  cv::transpose(picture, picture);
  fs::create_directories(folder);
  cv::imwrite(folder / ("approach_" + std::to_string(frame) + ".png"), picture);
}

// `railfix calibrate mount` with the guessed focal length; the angles shrink as the focal length grows.
geometry::CameraPose mount_for(double focal_px) {
  const double share = kGuessedFocalPx / focal_px;
  return {0, std::atan(share * std::tan(0.0509)), std::atan(share * std::tan(-0.0025)), 0.018, 3.044};
}

Measured measure(const Run& run, double focal_px) {
  const geometry::Intrinsics camera{focal_px, focal_px, 959.5, 539.5, 0, 0, 0, 0, 1920, 1080};
  const geometry::CameraPose mount = mount_for(focal_px);
  track_detector::TrackDetector detector(camera, mount, {});
  odometry::TrainMouseOptions options;
  options.far_m = run.far_m;
  odometry::TrainMouse mouse(camera, options);
  SleeperSpacing sleepers(camera, {mount, kTextureDepthM, 0, 0}, run.far_m);
  Measured measured;
  cv::Mat before;
  for (int frame = kFirst; frame <= kLast; ++frame) {
    const auto picture = look(detector, mount, picture_of(run.frames, frame), frame);
    const cv::Mat ground = sleepers.add(picture.grey, {picture.pose, kTextureDepthM, picture.curvature_per_m, 0});
    const auto step = mouse.process(picture);
    measured.steps[frame] = step;
    if (step.valid && !run.draw.empty())
      draw_overlay(run.draw, frame, before, ground, step.step_m, sleepers.sheet().cell_m);
    before = ground;
  }
  measured.sleepers_m = sleepers.spacing_m();
  return measured;
}

int compare(const Needle& needle, const Measured& measured) {
  std::printf("frame   step of the mouse     needle, set by the counter     speed.csv\n");
  int wrong = 0;
  int valid = 0;
  double way_m = 0, way_needle_m = 0, way_file_m = 0;
  for (const auto& [frame, step] : measured.steps) {
    const auto [needle_m, needle_sigma_m] = needle.step(frame);
    const char* verdict = "search";
    if (step.valid) {
      ++valid;
      way_m += step.step_m;
      way_needle_m += needle_m;
      way_file_m += needle.step_in_file(frame);
      const double sigma = std::hypot(step.step_sigma_m, kSleeperSigma * step.step_m, needle_sigma_m);
      const bool right = std::abs(step.step_m - needle_m) < 2 * sigma;
      if (!right) ++wrong;
      verdict = right ? "agree" : "DISAGREE";
      std::printf("%d   %.3f +- %.3f m", frame, step.step_m,
                  std::hypot(step.step_sigma_m, kSleeperSigma * step.step_m));
    } else {
      std::printf("%d   -                ", frame);
    }
    std::printf("     %.2f +- %.2f m     %.2f m   %s\n", needle_m, needle_sigma_m, needle.step_in_file(frame), verdict);
  }
  std::printf("valid %d of %zu, disagree %d; together %.2f m, the needle's %.2f m (%+.1f %%), speed.csv %.2f m\n",
              valid, measured.steps.size(), wrong, way_m, way_needle_m, 100 * (way_m / way_needle_m - 1), way_file_m);
  return valid > 0 && wrong == 0 ? 0 : 1;
}

int run(const Run& run, const fs::path& table) {
  const Needle needle(table);
  needle.print();
  const Measured guessed = measure({run.frames, {}, run.far_m}, kGuessedFocalPx);
  // All lengths along the track grow with the focal length: the gauge fixes the height alone.
  const double focal_px = kGuessedFocalPx * kSleeperM / guessed.sleepers_m;
  const Measured measured = measure(run, focal_px);
  std::printf(
      "sleepers: %.3f m apart with the guessed focal length of %.0f px; %.3f m with %.0f px (%.2f m +- %.0f %%)\n",
      guessed.sleepers_m, kGuessedFocalPx, measured.sleepers_m, focal_px, kSleeperM, 100 * kSleeperSigma);
  return compare(needle, measured);
}

}  // namespace

int main(int argc, char** argv) {
  Run options;
  CLI::App app("The train mouse on a real approach to a stop");
  app.add_option("--draw", options.draw, "Folder: two pictures' ground, laid over each other by the measured step");
  app.add_option("--far", options.far_m, "Farthest ground used, m");
  CLI11_PARSE(app, argc, argv);
  const fs::path cabview = data_folder() / "cabview";
  if (!fs::exists(cabview / "speed.csv")) {
    std::printf("skipped: no pictures in %s (set RAILFIX_DATA)\n", cabview.c_str());
    return 0;
  }
  options.frames = cabview / "frames";
  return run(options, cabview / "speed.csv");
}
