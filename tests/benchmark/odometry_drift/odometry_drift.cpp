// railfix-measure-odometry --dataset SEQ: drift of the train mouse alone, with the true camera poses or with poses made
// noisy, one line per 100 m and one for the whole run.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <unordered_map>

#include "core/random.hpp"
#include "core/time.hpp"
#include "dataset/dataset.hpp"
#include "odometry/train_mouse.hpp"
#include "track_detector/track_detector.hpp"

namespace railfix {
namespace {

struct Arguments {
  std::string dataset;
  std::string pose = "true";
  double pitch_noise_rad = 0;
  double pitch_bias_rad = 0;
  double height_noise_m = 0;
  double curvature_noise_per_m = 0;
  double vertical_curvature_noise_per_m = 0;
  size_t limit = 0;
  bool steps = false;
  bool no_vertical = false;
  odometry::TrainMouseOptions mouse;
};

Arguments parse(int argc, char** argv) {
  Arguments a;
  CLI::App app("Drift of the train mouse on a dataset with truth");
  app.add_option("--dataset", a.dataset, "Dataset folder")->required();
  app.add_option("--pose", a.pose, "true, detected (track_detector's) or mount")
      ->check(CLI::IsMember({"true", "detected", "mount"}));
  app.add_option("--pitch-noise", a.pitch_noise_rad, "Added to every pose, 1 sigma, rad; yaw and roll get the same");
  app.add_option("--pitch-bias", a.pitch_bias_rad, "Added to every pose, rad");
  app.add_option("--height-noise", a.height_noise_m, "Added to every pose, 1 sigma, m; lateral gets the same");
  app.add_option("--curvature-noise", a.curvature_noise_per_m, "1 sigma, 1/m");
  app.add_option("--vertical-noise", a.vertical_curvature_noise_per_m, "1 sigma, 1/m");
  app.add_flag("--no-vertical", a.no_vertical, "Vertical curvature is not known");
  app.add_option("--limit", a.limit, "Pictures");
  app.add_flag("--steps", a.steps, "Print every step");
  app.add_option("--texture-depth", a.mouse.texture_depth_m, "m");
  app.add_option("--reference-length", a.mouse.reference_length_m, "m");
  app.add_option("--far", a.mouse.far_m, "m");
  app.add_option("--near", a.mouse.near_m, "m");
  app.add_option("--cell", a.mouse.cell_m, "m");
  app.add_option("--bias-sigma", a.mouse.filter.pitch_bias_sigma_rad, "rad");
  app.add_option("--bias-walk", a.mouse.filter.pitch_bias_walk_rad_per_sqrt_m, "rad/sqrt(m)");
  app.add_option("--ballast-sigma", a.mouse.filter.ballast_depth_sigma_m, "m");
  app.add_option("--ballast-depth", a.mouse.filter.ballast_depth_m, "m");
  app.add_option("--ballast-walk", a.mouse.filter.ballast_depth_walk_m_per_sqrt_m, "m/sqrt(m)");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    std::exit(app.exit(error));
  }
  return a;
}

class Drift {
 public:
  void add(const dataset::TruthRow& truth, const odometry::MouseStep& step) {
    ++pictures_;
    valid_ += step.valid ? 1 : 0;
    if (!step.valid) return;
    if (begun_) {
      const double true_step = truth.distance_m - last_truth_m_;
      const double error = (step.distance_m - last_m_) - true_step;
      squared_ += error * error;
      if (std::abs(true_step) < 1e-4 && step.distance_m != last_m_) ++moved_at_rest_;
      at_rest_ += std::abs(true_step) < 1e-4 ? 1 : 0;
      travelled_ += std::abs(true_step);
      ++steps_;
    } else {
      begun_ = true;
      first_error_m_ = mark_error_m_ = step.distance_m - truth.distance_m;
      mark_m_ = truth.distance_m;
    }
    last_truth_m_ = truth.distance_m;
    last_m_ = step.distance_m;
    if (std::abs(truth.distance_m - mark_m_) >= 100.0) {
      const double error = step.distance_m - truth.distance_m;
      std::printf(
          "%8.1f m  %+8.3f m per 100 m   total %+8.3f m   speed %5.2f m/s   pitch bias %+.3f mrad   ballast %.1f mm\n",
          truth.distance_m, (error - mark_error_m_) * 100.0 / std::abs(truth.distance_m - mark_m_),
          error - first_error_m_, step.speed_mps, 1e3 * step.pitch_bias_rad, 1e3 * step.ballast_depth_m);
      worst_percent_ =
          std::max(worst_percent_, std::abs(error - mark_error_m_) / std::abs(truth.distance_m - mark_m_) * 100);
      mark_m_ = truth.distance_m;
      mark_error_m_ = error;
    }
  }
  void print(double seconds) const {
    const double error = last_m_ - last_truth_m_ - first_error_m_;
    std::printf("pictures %zu, valid %zu (%.2f %%), travelled %.1f m, drift %+.3f m = %+.4f %%, worst 100 m %.3f %%\n",
                pictures_, valid_, 100.0 * static_cast<double>(valid_) / static_cast<double>(pictures_), travelled_,
                error, 100.0 * error / std::max(1.0, travelled_), worst_percent_);
    std::printf("step error %.2f mm (1 sigma), at rest %zu pictures of which moved %zu, %.2f ms a picture\n",
                1e3 * std::sqrt(squared_ / static_cast<double>(std::max<size_t>(1, steps_))), at_rest_, moved_at_rest_,
                1e3 * seconds / static_cast<double>(std::max<size_t>(1, pictures_)));
  }

 private:
  bool begun_ = false;
  double first_error_m_ = 0, mark_m_ = 0, mark_error_m_ = 0, last_m_ = 0, last_truth_m_ = 0;
  double squared_ = 0, travelled_ = 0, worst_percent_ = 0;
  size_t pictures_ = 0, valid_ = 0, steps_ = 0, at_rest_ = 0, moved_at_rest_ = 0;
};

void disturb(const Arguments& a, core::Random& random, odometry::MousePicture& picture) {
  picture.pose.pitch_rad += a.pitch_bias_rad + random.normal(0, a.pitch_noise_rad);
  picture.pose.yaw_rad += random.normal(0, a.pitch_noise_rad);
  picture.pose.roll_rad += random.normal(0, a.pitch_noise_rad);
  picture.pose.lateral_m += random.normal(0, a.height_noise_m);
  picture.pose.height_m += random.normal(0, a.height_noise_m);
  picture.curvature_per_m += random.normal(0, a.curvature_noise_per_m);
  picture.vertical_curvature_per_m += random.normal(0, a.vertical_curvature_noise_per_m);
  if (a.no_vertical) picture.vertical_curvature_per_m = 0;
  picture.trust = {std::max(1e-5, a.pitch_noise_rad), std::max(1e-4, a.height_noise_m)};
}

void detect(track_detector::TrackDetector& detector, odometry::MousePicture& picture) {
  const auto seen = detector.detect(picture.grey);
  picture.pose = seen.shape.camera;
  picture.pose_measured = seen.seen();
  picture.trust = {std::sqrt(seen.covariance(1, 1)), std::sqrt(seen.covariance(4, 4))};
  picture.curvature_per_m = seen.shape.curvature_per_m;
  picture.vertical_curvature_per_m = seen.shape.vertical_curvature_per_m;
}

int measure(const Arguments& a) {
  const auto calibration = core::value_or_throw(dataset::read_calibration(a.dataset + "/mav0/cam0/sensor.yaml"));
  std::unordered_map<int64_t, dataset::TruthRow> truth;
  for (const auto& row : core::value_or_throw(dataset::read_truth(a.dataset + "/truth/track.csv")))
    truth[row.stamp_ns] = row;
  auto source = core::value_or_throw(dataset::open_pictures(a.dataset, {}));
  odometry::TrainMouse mouse(calibration.intrinsics, a.mouse);
  track_detector::TrackDetector detector(calibration.intrinsics, calibration.mount.value_or(geometry::CameraPose{}),
                                         {});
  core::Random random(1);
  Drift drift;
  double seconds = 0;
  for (size_t count = 0; a.limit == 0 || count < a.limit; ++count) {
    const auto next = core::value_or_throw(source->next());
    if (!next) break;
    const auto row = truth.find(next->stamp_ns);
    if (row == truth.end()) continue;
    odometry::MousePicture picture;
    picture.grey = next->grey;
    picture.stamp_ns = next->stamp_ns;
    if (a.pose == "true") {
      picture.pose = row->second.camera;
      picture.pose_measured = true;
      picture.curvature_per_m = row->second.curvature_per_m;
      picture.vertical_curvature_per_m = row->second.vertical_curvature_per_m;
      disturb(a, random, picture);
    } else if (a.pose == "detected") {
      detect(detector, picture);
      if (a.no_vertical) picture.vertical_curvature_per_m = 0;
    } else if (calibration.mount) {
      picture.pose = *calibration.mount;
    }
    const std::clock_t begin = std::clock();  // processor time: other programs do not count
    const odometry::MouseStep step = mouse.process(picture);
    seconds += static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC;
    if (a.steps) {
      std::printf(
          "%zu true %.4f m %.3f m/s  got %.4f m %.3f m/s step %+.4f +- %.4f mode %d valid %d patches %d agreement %.2f "
          "score %.2f\n",
          count, row->second.distance_m, row->second.speed_mps, step.distance_m, step.speed_mps, step.step_m,
          step.step_sigma_m, static_cast<int>(step.mode), step.valid ? 1 : 0, step.patches, step.agreement, step.score);
    }
    drift.add(row->second, step);
  }
  drift.print(seconds);
  return 0;
}

}  // namespace
}  // namespace railfix

int main(int argc, char** argv) {
  try {
    return railfix::measure(railfix::parse(argc, argv));
  } catch (const railfix::core::BadInput& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 2;
  }
}
