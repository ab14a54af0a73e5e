#include <cstdio>
#include <memory>
#include <thread>

#include "commands.hpp"
#include "core/units.hpp"
#include "progress.hpp"
#include "simulator/simulation.hpp"

namespace railfix::tool {
namespace {

struct Settings {
  simulator::SimulationOptions simulation;
  std::string map;
  std::string size = "1280x1024";
  double focal_px = 0;
  double speed_kmh = 72;
  double pitch_deg = 12;
  std::vector<double> distortion;
  bool no_pictures = false;
  bool quiet = false;
};

// Everything of the camera that follows from the size.
geometry::Intrinsics intrinsics(const Settings& settings) {
  geometry::Intrinsics camera;
  char rest = 0;
  if (std::sscanf(settings.size.c_str(), "%dx%d%c", &camera.width_px, &camera.height_px, &rest) != 2 ||
      camera.width_px < 32 || camera.height_px < 32 || camera.width_px > 8192 || camera.height_px > 8192) {
    throw core::BadInput("--size " + settings.size +
                         " is not WIDTHxHEIGHT between 32 and 8192 pixels; write for example --size 1280x1024");
  }
  camera.fu_px = camera.fv_px = settings.focal_px > 0 ? settings.focal_px : 0.9 * camera.width_px;
  camera.cu_px = 0.5 * (camera.width_px - 1);
  camera.cv_px = 0.5 * (camera.height_px - 1);
  if (!settings.distortion.empty()) {
    camera.k1 = settings.distortion[0];
    camera.k2 = settings.distortion[1];
    camera.p1 = settings.distortion[2];
    camera.p2 = settings.distortion[3];
  }
  return camera;
}

int simulate(Settings& settings) {
  auto& simulation = settings.simulation;
  simulation.render.camera = intrinsics(settings);
  simulation.run.cruise_mps = core::mps_from_kmh(settings.speed_kmh);
  simulation.mount.pitch_rad = core::rad_from_deg(settings.pitch_deg);
  simulation.pictures = !settings.no_pictures;
  if (simulation.run.duration_s > 0) simulation.run.length_m = 0;
  if (!settings.map.empty())
    simulation.map = std::make_shared<const track::Map>(core::value_or_throw(track::Map::load(settings.map)));
  std::unique_ptr<Progress> bar;
  const auto report = core::value_or_throw(simulator::simulate(simulation, [&](size_t done, size_t total) {
    if (!bar) bar = std::make_unique<Progress>("pictures", total, settings.quiet);
    bar->update(done);
  }));
  if (bar) bar->finish();
  std::fprintf(stderr, "%s: %.1f m in %.1f s, %zu pictures (%.1f ms each to render)\n", simulation.out.c_str(),
               report.length_m, report.duration_s, report.pictures, report.render_ms);
  return 0;
}

void add_camera_options(CLI::App& app, Settings& settings) {
  auto& simulation = settings.simulation;
  const std::string group = "Camera";
  app.add_option("--size", settings.size, "WIDTHxHEIGHT in pixels")->capture_default_str()->group(group);
  app.add_option("--rate-hz", simulation.rate_hz, "pictures a second")
      ->check(CLI::Range(0.1, 1000.0))
      ->capture_default_str()
      ->group(group);
  app.add_option("--focal-px", settings.focal_px, "focal length (default 0.9 x width)")
      ->check(CLI::Range(10.0, 50000.0))
      ->group(group);
  app.add_option("--distortion", settings.distortion, "k1 k2 p1 p2 of the lens (default none)")
      ->expected(4)
      ->group(group);
  app.add_option("--height-m", simulation.mount.height_m, "camera over the rail heads")
      ->check(CLI::Range(0.3, 20.0))
      ->capture_default_str()
      ->group(group);
  app.add_option("--pitch-deg", settings.pitch_deg, "camera down")
      ->check(CLI::Range(-10.0, 80.0))
      ->capture_default_str()
      ->group(group);
  app.add_option("--lateral-m", simulation.mount.lateral_m, "camera left of the track's middle")
      ->check(CLI::Range(-3.0, 3.0))
      ->capture_default_str()
      ->group(group);
  app.add_option("--exposure-s", simulation.exposure_s, "motion blur = speed x exposure")
      ->check(CLI::Range(0.0, 0.1))
      ->capture_default_str()
      ->group(group);
  app.add_option("--gain-wander", simulation.gain_wander, "slow change of brightness, 1 sigma")
      ->check(CLI::Range(0.0, 0.5))
      ->capture_default_str()
      ->group(group);
  app.add_option("--noise-grey", simulation.render.read_noise_grey, "noise in the dark, 1 sigma")
      ->check(CLI::Range(0.0, 50.0))
      ->capture_default_str()
      ->group(group);
  app.add_option("--shake", simulation.shake.scale,
                 "shake of the camera, 1 = roll 0.09, pitch 0.14, yaw 0.09 deg, 10 mm at 72 km/h")
      ->check(CLI::Range(0.0, 20.0))
      ->capture_default_str()
      ->group(group);
  app.add_option("--texture-depth-m", simulation.render.texture_depth_m, "sleeper tops below the rail heads")
      ->check(CLI::Range(0.0, 1.0))
      ->capture_default_str()
      ->group(group);
  app.add_option("--format", simulation.format, "png, jpg or pgm")
      ->check(CLI::IsMember({"png", "jpg", "pgm"}))
      ->capture_default_str()
      ->group(group);
  app.add_option("--jpeg-quality", simulation.jpeg_quality)
      ->check(CLI::Range(1, 100))
      ->capture_default_str()
      ->group(group);
  app.add_option("--only-ahead-m", simulation.render.strip.ahead_m,
                 "draw the own track so far ahead and nothing else, for long runs (0 = whole pictures)")
      ->check(CLI::Range(0.0, 200.0))
      ->capture_default_str()
      ->group(group);
  app.add_option("--only-beside-m", simulation.render.strip.beside_m, "with --only-ahead-m: so far to each side")
      ->check(CLI::Range(0.8, 20.0))
      ->capture_default_str()
      ->group(group);
  app.add_flag("--no-pictures", settings.no_pictures, "sensors and truth only")->group(group);
}

void add_sensor_options(CLI::App& app, simulator::SensorOptions& sensors) {
  const std::string group = "Sensor errors (1 sigma)";
  const auto option = [&](const char* name, double& value, const char* what) {
    app.add_option(name, value, what)->check(CLI::NonNegativeNumber)->capture_default_str()->group(group);
  };
  option("--gyro-noise", sensors.gyro_noise_rps, "rad/s a sample");
  option("--gyro-bias", sensors.gyro_bias_rps, "rad/s");
  option("--accel-noise", sensors.accel_noise_mps2, "m/s2 a sample");
  option("--accel-bias", sensors.accel_bias_mps2, "m/s2");
  option("--pulses-per-metre", sensors.pulses_per_metre, "of the wheel sensor, as its data sheet says");
  app.add_option("--wheel-scale", sensors.wheel_scale_error, "share of pulses too many")
      ->check(CLI::Range(-0.2, 0.2))
      ->capture_default_str()
      ->group(group);
  app.add_option("--slips", sensors.slip_episodes, "times that the wheel slips or slides")
      ->check(CLI::Range(0, 1000))
      ->capture_default_str()
      ->group(group);
  option("--gnss-sigma-m", sensors.gnss_sigma_m, "horizontal");
  option("--gnss-outliers", sensors.gnss_outlier_share, "share of positions that are 15 m off");
}

}  // namespace

void add_simulate(CLI::App& app, Action& chosen) {
  auto settings = std::make_shared<Settings>();
  auto& simulation = settings->simulation;
  auto* command =
      app.add_subcommand("simulate",
                         "A virtual train on a map: cab pictures, IMU, wheel and GNSS with ground truth.\n"
                         "Example, 300 m of the built-in line over its first curve, then run Railfix on it:\n"
                         "  railfix simulate --start 1:250 --length-m 300 --speed-kmh 72 --out /tmp/demo\n"
                         "  railfix run --dataset /tmp/demo --start 1:250:+ --out /tmp/demo-run\n"
                         "The same seed gives the same bytes.");
  command->add_option("--out", simulation.out, "dataset folder to write (new or empty)")->required();
  auto* map = command->add_option("--map", settings->map, "map made by `railfix map build` (default: a built-in line)")
                  ->check(CLI::ExistingFile);
  command->add_option("--line", simulation.line, "built-in line: default (4 km) or long (30 km)")
      ->check(CLI::IsMember({"default", "long"}))
      ->excludes(map)
      ->capture_default_str();
  command->add_option("--via", simulation.via, "edges to turn to at switches, else the straight way is run");
  command->add_option("--start", simulation.start, "EDGE:OFFSET[:+|-] where the train stands first")
      ->capture_default_str();
  command->add_option("--length-m", simulation.run.length_m, "way to run")
      ->check(CLI::Range(1.0, 1e6))
      ->capture_default_str();
  command->add_option("--duration-s", simulation.run.duration_s, "time to run, instead of --length-m")
      ->check(CLI::Range(1.0, 1e5));
  command->add_option("--speed-kmh", settings->speed_kmh, "cruising speed")
      ->check(CLI::Range(1.0, 400.0))
      ->capture_default_str();
  command->add_option("--accelerate", simulation.run.accelerate_mps2, "m/s2")
      ->check(CLI::Range(0.05, 5.0))
      ->capture_default_str();
  command->add_option("--brake", simulation.run.brake_mps2, "m/s2")
      ->check(CLI::Range(0.05, 5.0))
      ->capture_default_str();
  command->add_option("--dwell-s", simulation.run.dwell_s, "standing still at both ends")
      ->check(CLI::Range(0.0, 3600.0))
      ->capture_default_str();
  command->add_option("--stop-at-m", simulation.run.stop_at_m, "stop on the way here (0 = no stop)")
      ->check(CLI::Range(0.0, 1e6))
      ->capture_default_str();
  command->add_option("--stop-s", simulation.run.stop_s, "how long it stops")
      ->check(CLI::Range(0.0, 3600.0))
      ->capture_default_str();
  command->add_option("--seed", simulation.seed)->capture_default_str();
  command->add_option("--threads", simulation.threads, "pictures rendered at a time")
      ->check(CLI::Range(1, 256))
      ->capture_default_str();
  command->add_flag("--quiet", settings->quiet, "no progress bar");
  add_camera_options(*command, *settings);
  add_sensor_options(*command, simulation.sensors);
  command->callback([settings, &chosen] { chosen = [settings] { return simulate(*settings); }; });
}

}  // namespace railfix::tool
