// railfix-measure-odometry: drift of the train mouse alone, on a dataset or on pictures drawn on the way (--simulate),
// with the poses of track_detector, with true poses made noisy, or with the mount's.
#include <CLI/CLI.hpp>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <map>
#include <vector>

#include "core/random.hpp"
#include "core/units.hpp"
#include "drift.hpp"
#include "odometry/train_mouse.hpp"
#include "scene.hpp"
#include "simulator/simulator_config.hpp"
#include "track_detector/track_detector.hpp"

namespace railfix {
namespace {

struct Arguments {
  std::string dataset;
  simulator::SimulationOptions simulation;
  Disturbances disturbances;
  std::string map;
  std::vector<std::string> scenarios;
  double speed_kmh = 72;
  double pitch_deg = 12;
  double focal_px = 1509;  // 8 mm and 5.3 um, as in paper 002
  int width_px = 1280, height_px = 1024;
  std::string pose = "detected";
  double height_error_m = 0;
  double pitch_noise_rad = 0, pitch_bias_rad = 0, height_noise_m = 0, curvature_noise_per_m = 0;
  size_t limit = 0;
  bool steps = false;
  bool windows = false;
  track_detector::DetectorOptions detector;
  odometry::TrainMouseOptions mouse;
};

void add_simulation(CLI::App& app, Arguments& a) {
  auto& simulation = a.simulation;
  app.add_option("--simulate", simulation.start, "Draw the pictures on the way, from EDGE:OFFSET")->group("Simulation");
  app.add_option("--map", a.map, "Compiled map")->group("Simulation");
  app.add_option("--line", simulation.line, "Without a map: default or long")->group("Simulation");
  app.add_option("--length-m", simulation.run.length_m, "")->group("Simulation");
  app.add_option("--speed-kmh", a.speed_kmh, "")->group("Simulation");
  app.add_option("--accelerate", simulation.run.accelerate_mps2, "m/s^2; brakes alike")->group("Simulation");
  app.add_option("--dwell-s", simulation.run.dwell_s, "Standing at both ends")->group("Simulation");
  app.add_option("--stop-at-m", simulation.run.stop_at_m, "")->group("Simulation");
  app.add_option("--stop-s", simulation.run.stop_s, "")->group("Simulation");
  app.add_option("--rate-hz", simulation.rate_hz, "")->group("Simulation");
  app.add_option("--pitch-deg", a.pitch_deg, "")->group("Simulation");
  app.add_option("--focal-px", a.focal_px, "")->group("Simulation");
  app.add_option("--width-px", a.width_px, "")->group("Simulation");
  app.add_option("--height-px", a.height_px, "")->group("Simulation");
  app.add_option("--height-m", simulation.mount.height_m, "")->group("Simulation");
  app.add_option("--shake", simulation.shake.scale, "")->group("Simulation");
  app.add_option("--exposure-s", simulation.scenario.exposure.time_s, "")->group("Simulation");
  app.add_option("--seed", simulation.seed, "")->group("Simulation");
  app.add_option("--drop", a.disturbances.drop_share, "Share of pictures lost")->group("Simulation");
  app.add_option("--gain-wander", simulation.scenario.exposure.wander, "Slow change of brightness, 1 sigma")
      ->group("Simulation");
  app.add_option("--idle-shake", a.disturbances.idle_shake, "Vibration also at rest: 1 = 0.3 mrad, 1 mm")
      ->group("Simulation");
  app.add_option("--rest-s", a.disturbances.rest_s, "The stop (--stop-at-m, --stop-s) is looped to last so long")
      ->group("Simulation");
  app.add_option("--scenario", a.scenarios, "Scenario file, as deploy/scenarios/rain_wiper.yaml; more than one add up")
      ->group("Simulation");
  app.add_flag("--whole-picture", a.disturbances.whole_picture, "Draw it all, with scenery and other trains (slow)")
      ->group("Simulation");
  app.add_option("--other-trains", simulation.other_trains, "Met on the way, in the whole picture")
      ->group("Simulation");
  const std::map<std::string, Way> ways{
      {"forward", Way::forward}, {"reverse", Way::reverse}, {"there-and-back", Way::there_and_back}};
  app.add_option("--way", a.disturbances.way, "forward, reverse or there-and-back")
      ->transform(CLI::CheckedTransformer(ways))
      ->group("Simulation");
  app.add_option("--jitter-s", a.disturbances.stamp_jitter_s, "Of the stamps, 1 sigma")->group("Simulation");
}

void add_mouse(CLI::App& app, odometry::TrainMouseOptions& mouse) {
  const std::string group = "Train mouse";
  app.add_option("--texture-depth", mouse.texture_depth_m, "m")->group(group);
  app.add_option("--reference-length", mouse.reference_length_m, "m")->group(group);
  app.add_option("--far", mouse.far_m, "m")->group(group);
  app.add_option("--near", mouse.near_m, "m")->group(group);
  app.add_option("--cell", mouse.cell_m, "m")->group(group);
  app.add_option("--bias-sigma", mouse.filter.pitch_bias_sigma_rad, "rad")->group(group);
  app.add_option("--bias-length", mouse.filter.pitch_bias_length_m, "m")->group(group);
  app.add_option("--ballast-sigma", mouse.filter.ballast_depth_sigma_m, "m")->group(group);
  app.add_option("--ballast-depth", mouse.filter.ballast_depth_m, "m")->group(group);
  app.add_option("--ballast-walk", mouse.filter.ballast_depth_walk_m_per_sqrt_m, "m/sqrt(m)")->group(group);
  app.add_option("--ballast-scatter", mouse.filter.ballast_scatter_m, "m")->group(group);
}

// What the files do not say stays as it is.
void read_scenarios(const std::vector<std::string>& files, simulator::SimulationOptions& simulation) {
  simulator::SimulatorConfig config{simulation.scenario, simulation.render, simulation.shake};
  for (const auto& file : files) {
    const auto status =
        service::read_section("simulator", file, {}, {}, [&](service::Fields& fields) { config.describe(fields); });
    if (!status.ok()) throw core::BadInput(status.error().message);
  }
  simulation.scenario = config.scenario;
  simulation.render = config.render;
  simulation.shake = config.shake;
}

Arguments parse(int argc, char** argv) {
  Arguments a;
  a.simulation.rate_hz = 60;
  a.simulation.start = "";
  CLI::App app("Drift of the train mouse where the truth is known");
  app.add_option("--dataset", a.dataset, "Dataset folder with truth");
  add_simulation(app, a);
  app.add_option("--pose", a.pose, "detected (track_detector's), true or mount")
      ->check(CLI::IsMember({"true", "detected", "mount"}));
  app.add_option("--height-error", a.height_error_m, "The calibration's height is wrong by so much, m");
  app.add_option("--pitch-noise", a.pitch_noise_rad, "Added to true poses, 1 sigma, rad; yaw and roll get the same");
  app.add_option("--pitch-bias", a.pitch_bias_rad, "Added to true and detected poses, rad");
  app.add_option("--height-noise", a.height_noise_m, "Added to true poses, 1 sigma, m; lateral gets the same");
  app.add_option("--curvature-noise", a.curvature_noise_per_m, "Added to the true curvature, 1 sigma, 1/m");
  app.add_option("--rails-far", a.detector.far_m, "Rails are followed as far as this, m");
  app.add_option("--limit", a.limit, "Pictures");
  app.add_flag("--steps", a.steps, "Print every step");
  app.add_flag("--windows", a.windows, "Print every 100 m");
  add_mouse(app, a.mouse);
  try {
    app.parse(argc, argv);
    if (!a.scenarios.empty()) {
      read_scenarios(a.scenarios, a.simulation);
      app.parse(argc, argv);  // options go over the files
    }
    if (a.dataset.empty() == a.simulation.start.empty())
      throw CLI::ValidationError("say either --dataset FOLDER or --simulate EDGE:OFFSET");
  } catch (const CLI::ParseError& error) {
    std::exit(app.exit(error));
  }
  return a;
}

std::unique_ptr<Scene> open_scene(Arguments& a) {
  if (!a.dataset.empty()) return open_dataset(a.dataset);
  auto& simulation = a.simulation;
  if (!a.map.empty())
    simulation.map = std::make_shared<const track::Map>(core::value_or_throw(track::Map::load(a.map)));
  const auto lens = simulation.render.camera;
  simulation.render.camera = {
      a.focal_px, a.focal_px, 0.5 * (a.width_px - 1), 0.5 * (a.height_px - 1), lens.k1, lens.k2, lens.p1, lens.p2,
      a.width_px, a.height_px};
  simulation.mount.pitch_rad = core::rad_from_deg(a.pitch_deg);
  simulation.run.cruise_mps = core::mps_from_kmh(a.speed_kmh);
  simulation.run.brake_mps2 = simulation.run.accelerate_mps2;
  return simulate_track(simulation, a.disturbances);
}

// Where the mouse gets its poses from.
class PoseSource {
 public:
  PoseSource(const Arguments& a, const dataset::CameraCalibration& calibration)
      : a_(a), mount_(calibration.mount.value_or(geometry::CameraPose{})), random_(1) {
    mount_.height_m += a.height_error_m;
    detector_ = std::make_unique<track_detector::TrackDetector>(calibration.intrinsics, mount_, a.detector);
  }
  odometry::MousePicture picture(const Moment& moment) {
    odometry::MousePicture picture;
    picture.grey = moment.grey;
    picture.stamp_ns = moment.stamp_ns;
    picture.exposure_s = moment.exposure_s;
    picture.pose = mount_;
    if (a_.pose == "true") noisy_truth(moment.truth, picture);
    if (a_.pose == "detected") detect(picture);
    return picture;
  }

 private:
  void noisy_truth(const dataset::TruthRow& truth, odometry::MousePicture& picture) {
    picture.pose = truth.camera;
    picture.pose.pitch_rad += a_.pitch_bias_rad + random_.normal(0, a_.pitch_noise_rad);
    picture.pose.yaw_rad += random_.normal(0, a_.pitch_noise_rad);
    picture.pose.roll_rad += random_.normal(0, a_.pitch_noise_rad);
    picture.pose.lateral_m += random_.normal(0, a_.height_noise_m);
    picture.pose.height_m += random_.normal(0, a_.height_noise_m);
    picture.pose_measured = true;
    picture.trust =
        odometry::PoseTrust::independent(std::max(1e-5, a_.pitch_noise_rad), std::max(1e-4, a_.height_noise_m));
    picture.curvature_per_m = truth.curvature_per_m + random_.normal(0, a_.curvature_noise_per_m);
    picture.vertical_curvature_per_m = truth.vertical_curvature_per_m;
  }
  // As odometry_service takes it from track_view.
  void detect(odometry::MousePicture& picture) {
    const auto seen = detector_->detect(picture.grey);
    constexpr int kOf[3] = {1, 4, 6};  // pitch, height, vertical curvature
    odometry::PoseTrust trust;
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) trust.covariance(i, j) = seen.covariance(kOf[i], kOf[j]);
    }
    const bool good = (seen.seen_left || seen.seen_right) && trust.pitch_sigma_rad() < a_.mouse.mount_pitch_sigma_rad;
    if (good) {
      last_ = seen.shape.camera;
      last_->pitch_rad += a_.pitch_bias_rad;
      if (std::sqrt(seen.covariance(5, 5)) < 1e-3) curvature_per_m_ = seen.shape.curvature_per_m;
      picture.trust = trust;
    }
    picture.pose_measured = good;
    picture.pose = last_.value_or(mount_);
    picture.curvature_per_m = curvature_per_m_;
    picture.vertical_curvature_per_m = seen.shape.vertical_curvature_per_m;
  }
  const Arguments& a_;
  geometry::CameraPose mount_;
  core::Random random_;
  std::unique_ptr<track_detector::TrackDetector> detector_;
  std::optional<geometry::CameraPose> last_;
  double curvature_per_m_ = 0;
};

void print_step(size_t count, const Moment& moment, const odometry::MousePicture& picture,
                const odometry::MouseStep& step) {
  std::printf(
      "%zu true %.4f m %.3f m/s  got %.4f m %.3f m/s step %+.4f +- %.4f mode %d valid %d patches %d agreement %.2f "
      "score %.2f lateral %+.4f yaw %+.5f pitch error %+.6f +- %.6f height error %+.5f +- %.5f vertical %+.7f error "
      "%+.7f\n",
      count, moment.truth.distance_m, moment.truth.speed_mps, step.distance_m, step.speed_mps, step.step_m,
      step.step_sigma_m, static_cast<int>(step.mode), step.valid ? 1 : 0, step.patches, step.agreement, step.score,
      step.lateral_m, step.yaw_rad, picture.pose.pitch_rad - moment.truth.camera.pitch_rad,
      picture.trust.pitch_sigma_rad(), picture.pose.height_m - moment.truth.camera.height_m,
      std::sqrt(picture.trust.covariance(1, 1)), moment.truth.vertical_curvature_per_m,
      picture.vertical_curvature_per_m - moment.truth.vertical_curvature_per_m);
}

int measure(Arguments a) {
  cv::setNumThreads(1);
  const auto scene = open_scene(a);
  odometry::TrainMouse mouse(scene->calibration().intrinsics, a.mouse);
  PoseSource poses(a, scene->calibration());
  Drift drift(a.windows);
  for (size_t count = 0; a.limit == 0 || count < a.limit; ++count) {
    const auto moment = scene->next();
    if (!moment) break;
    const odometry::MousePicture picture = poses.picture(*moment);
    const std::clock_t begin = std::clock();  // processor time: other programs do not count
    const odometry::MouseStep step = mouse.process(picture);
    const double seconds = static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC;
    if (a.steps) print_step(count, *moment, picture, step);
    drift.add(moment->truth, step, seconds);
  }
  drift.print();
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
