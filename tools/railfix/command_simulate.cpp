#include <cstdio>
#include <memory>
#include <thread>

#include "commands.hpp"
#include "core/units.hpp"
#include "number_between.hpp"
#include "progress.hpp"
#include "scenario_files.hpp"
#include "simulator/simulation.hpp"
#include "simulator/simulator_config.hpp"
#include "whole_number.hpp"

namespace railfix::tool {
namespace {

constexpr const char* kSection = "simulator";

struct Settings {
  simulator::SimulationOptions simulation;
  std::string map;
  std::string size = "1280x1024";
  double focal_px = 0;
  double speed_kmh = 72;
  double pitch_deg = 12;
  std::vector<std::string> scenarios;
  std::vector<std::string> sets;
  std::vector<service::Override> shorthands;  // options that stand for a key
  bool list_scenarios = false;
  bool document = false;
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
  return camera;
}

// Scenario files one over the other, then --set, then the options that stand for a key.
simulator::SimulatorConfig read_scenarios(const Settings& settings) {
  std::vector<service::Override> changes;
  for (const auto& set : settings.sets) {
    const auto equals = set.find('=');
    if (equals == std::string::npos)
      throw core::BadInput("--set " + set + " is not key=value, like rain.intensity=0.5");
    const std::string key = set.substr(0, equals);
    const bool whole = key.starts_with(kSection + std::string("."));
    changes.push_back({(whole ? "" : kSection + std::string(".")) + key, set.substr(equals + 1)});
  }
  changes.insert(changes.end(), settings.shorthands.begin(), settings.shorthands.end());
  simulator::SimulatorConfig config;
  const auto read = [&](const std::filesystem::path& file, const std::vector<service::Override>& over) {
    const auto status =
        service::read_section(kSection, file, over, {}, [&](service::Fields& fields) { config.describe(fields); });
    if (!status.ok()) throw core::BadInput(status.error().message);
  };
  for (const auto& name : settings.scenarios) read(core::value_or_throw(find_scenario(name)), {});
  read({}, changes);
  return config;
}

int list_scenarios() {
  for (const auto& scenario : ready_scenarios())
    std::printf("%-20s %s\n", scenario.name.c_str(), scenario.what.c_str());
  return 0;
}

void apply(Settings& settings, simulator::SimulatorConfig config) {
  auto& simulation = settings.simulation;
  auto camera = intrinsics(settings);
  const auto& lens = config.render.camera;
  camera.k1 = lens.k1;
  camera.k2 = lens.k2;
  camera.p1 = lens.p1;
  camera.p2 = lens.p2;
  const double texture_depth_m = simulation.render.texture_depth_m;
  simulation.scenario = config.scenario;
  simulation.shake = config.shake;
  simulation.render = config.render;
  simulation.render.camera = camera;
  simulation.render.texture_depth_m = texture_depth_m;
  simulation.description =
      "# What `railfix simulate` drew here; seed " + std::to_string(simulation.seed) + ".\n" +
      service::document_section(kSection, [&](service::Fields& fields) { config.describe(fields); });
}

int simulate(Settings& settings) {
  if (settings.list_scenarios) return list_scenarios();
  if (settings.document) {
    std::fputs(service::document_config<simulator::SimulatorConfig>(kSection).c_str(), stdout);
    return 0;
  }
  auto& simulation = settings.simulation;
  if (simulation.out.empty()) throw core::BadInput("--out is missing: name the dataset folder to write (new or empty)");
  apply(settings, read_scenarios(settings));
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
  if (report.length_m < simulation.run.length_m - 1)
    std::fprintf(stderr, "railfix: the line ends there: not the %.0f m of --length-m\n", simulation.run.length_m);
  if (report.duration_s < simulation.run.duration_s - 1)
    std::fprintf(stderr, "railfix: the line ends there: not the %.0f s of --duration-s\n", simulation.run.duration_s);
  return 0;
}

void add_camera_options(CLI::App& app, Settings& settings) {
  auto& simulation = settings.simulation;
  const std::string group = "Camera";
  app.add_option("--size", settings.size, "WIDTHxHEIGHT in pixels")->capture_default_str()->group(group);
  app.add_option("--rate-hz", simulation.rate_hz, "pictures a second")
      ->check(number_between(0.1, 1000.0))
      ->capture_default_str()
      ->group(group);
  app.add_option("--focal-px", settings.focal_px, "focal length (default 0.9 x width)")
      ->check(number_between(10.0, 50000.0))
      ->group(group);
  app.add_option("--height-m", simulation.mount.height_m, "camera over the rail heads")
      ->check(number_between(0.3, 20.0))
      ->capture_default_str()
      ->group(group);
  app.add_option("--pitch-deg", settings.pitch_deg, "camera down")
      ->check(number_between(-10.0, 80.0))
      ->capture_default_str()
      ->group(group);
  app.add_option("--lateral-m", simulation.mount.lateral_m, "camera left of the track's middle")
      ->check(number_between(-3.0, 3.0))
      ->capture_default_str()
      ->group(group);
  app.add_option("--texture-depth-m", simulation.render.texture_depth_m, "sleeper tops below the rail heads")
      ->check(number_between(0.0, 1.0))
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
  app.add_flag("--no-pictures", settings.no_pictures, "sensors and truth only")->group(group);
}

void add_scenario_options(CLI::App& app, Settings& settings) {
  const std::string group = "Weather, light and camera (docs/configuration/simulation.md)";
  app.add_option("--scenario", settings.scenarios,
                 "FILE or name of a ready one; several: the later goes over the former")
      ->group(group);
  app.add_option("--set", settings.sets, "key=value over it, for example rain.intensity=0.5; may be repeated")
      ->group(group);
  app.add_flag("--list-scenarios", settings.list_scenarios, "say which are ready and end")->group(group);
  app.add_flag("--document", settings.document, "print every key as YAML to begin with and end")->group(group);
  const auto shorthand = [&](const char* name, const std::string& key) {
    app.add_option_function<std::string>(
           name,
           [&settings, key](const std::string& value) {
             settings.shorthands.push_back({kSection + std::string(".") + key, value});
           },
           "--set " + key)
        ->group(group);
  };
  shorthand("--exposure-s", "exposure.time_s");
  shorthand("--gain-wander", "exposure.wander");
  shorthand("--noise-grey", "exposure.read_noise_grey");
  shorthand("--shake", "vibration.shake");
  shorthand("--only-ahead-m", "strip.ahead_m");
  shorthand("--only-beside-m", "strip.beside_m");
}

void add_sensor_options(CLI::App& app, simulator::SensorOptions& sensors) {
  const std::string group = "Sensor errors (1 sigma)";
  const auto option = [&](const char* name, double& value, const char* what) {
    app.add_option(name, value, what)->check(number_between(0, 1e9))->capture_default_str()->group(group);
  };
  option("--gyro-noise", sensors.gyro_noise_rps, "rad/s a sample");
  option("--gyro-bias", sensors.gyro_bias_rps, "rad/s");
  option("--accel-noise", sensors.accel_noise_mps2, "m/s2 a sample");
  option("--accel-bias", sensors.accel_bias_mps2, "m/s2");
  option("--pulses-per-metre", sensors.pulses_per_metre, "of the wheel sensor, as its data sheet says");
  app.add_option("--wheel-scale", sensors.wheel_scale_error, "share of pulses too many")
      ->check(number_between(-0.2, 0.2))
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
  command->add_option("--out", simulation.out, "dataset folder to write (new or empty)");
  auto* map = command->add_option("--map", settings->map, "map made by `railfix map build` (default: a built-in line)")
                  ->check(CLI::ExistingFile);
  command->add_option("--line", simulation.line, "built-in line: default (4 km) or long (30 km)")
      ->check(CLI::IsMember({"default", "long"}))
      ->excludes(map)
      ->capture_default_str();
  command->add_option("--via", simulation.via, "edges to turn to at switches, else the straight way is run");
  command->add_option("--other-trains", simulation.other_trains, "trains met on the tracks beside the line")
      ->check(CLI::Range(0, 1000))
      ->capture_default_str();
  command->add_option("--start", simulation.start, "EDGE:OFFSET[:+|-] where the train stands first")
      ->capture_default_str();
  auto* length = command->add_option("--length-m", simulation.run.length_m, "way to run")
                     ->check(number_between(1.0, 1e6))
                     ->capture_default_str();
  command->add_option("--duration-s", simulation.run.duration_s, "time to run, instead of --length-m")
      ->check(number_between(1.0, 1e5))
      ->excludes(length);
  command->add_option("--speed-kmh", settings->speed_kmh, "cruising speed")
      ->check(number_between(1.0, 400.0))
      ->capture_default_str();
  command->add_option("--accelerate", simulation.run.accelerate_mps2, "m/s2")
      ->check(number_between(0.05, 5.0))
      ->capture_default_str();
  command->add_option("--brake", simulation.run.brake_mps2, "m/s2")
      ->check(number_between(0.05, 5.0))
      ->capture_default_str();
  command->add_option("--dwell-s", simulation.run.dwell_s, "standing still at both ends")
      ->check(number_between(0.0, 3600.0))
      ->capture_default_str();
  command->add_option("--stop-at-m", simulation.run.stop_at_m, "stop on the way here (0 = no stop)")
      ->check(number_between(0.0, 1e6))
      ->capture_default_str();
  command->add_option("--stop-s", simulation.run.stop_s, "how long it stops")
      ->check(number_between(0.0, 3600.0))
      ->capture_default_str();
  command->add_option("--seed", simulation.seed)->check(whole_number())->capture_default_str();
  command->add_option("--threads", simulation.threads, "pictures rendered at a time")
      ->check(CLI::Range(1, 256))
      ->capture_default_str();
  command->add_flag("--quiet", settings->quiet, "no progress bar");
  add_camera_options(*command, *settings);
  add_scenario_options(*command, *settings);
  add_sensor_options(*command, simulation.sensors);
  command->callback([settings, &chosen] { chosen = [settings] { return simulate(*settings); }; });
}

}  // namespace railfix::tool
