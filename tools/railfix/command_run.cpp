// `railfix run`: recorded data through the real services.
#include <csignal>
#include <filesystem>
#include <iostream>

#include "commands.hpp"
#include "core/joined.hpp"
#include "core/result.hpp"
#include "number_between.hpp"
#include "progress.hpp"
#include "run/draw_run.hpp"
#include "run/live_table.hpp"
#include "run/run_plan.hpp"
#include "run/supervisor.hpp"
#include "run_tables.hpp"
#include "service/notes.hpp"
#include "train/run.hpp"

namespace railfix::tool {
namespace {

constexpr double kConnectS = 90;
constexpr double kAnswerS = 10;
constexpr double kStopS = 15;
constexpr double kTurnS = 0.1;
constexpr int kRefused = 2;  // exit code of a service that does not accept its settings

volatile std::sig_atomic_t interrupted = 0;

std::vector<std::string> needed_of(const std::vector<ServiceProgram>& programs) {
  std::vector<std::string> names;
  for (const auto& program : programs) {
    if (program.needed) names.push_back(program.service);
  }
  return names;
}

// Without the camera's where there is none: then the sensors give the time, at the recorded rate.
std::vector<ServiceProgram> programs_for(const RunPlan& plan, const RunOptions& options) {
  auto programs = core::value_or_throw(find_service_programs());
  if (plan.has_camera) return programs;
  std::erase_if(programs, [](const ServiceProgram& program) { return is_of_camera(program.service); });
  std::cerr << "railfix: " << options.source.string()
            << " has no pictures: its sensors are played at the recorded rate, and no service of the camera runs\n";
  return programs;
}

void add_sets(const std::vector<std::string>& sets, std::vector<std::string>& arguments) {
  for (const auto& set : sets) {
    arguments.push_back("--set");
    arguments.push_back(set);
  }
}

// Each service looks at what the user has set, before there is a run.
void check_settings(const RunOptions& options) {
  if (options.config.empty() && options.sets.empty()) return;
  for (const auto& program : core::value_or_throw(find_service_programs())) {
    std::vector<std::string> command{program.program.string(), "--check"};
    if (!options.config.empty()) command.insert(command.end(), {"--config", options.config.string()});
    add_sets(options.sets, command);
    const auto [exit_code, text] = run(command);
    if (exit_code == kRefused) throw core::BadInput(text);
  }
}

void start_services(Processes& processes, const std::vector<ServiceProgram>& programs, const RunPlan& plan,
                    const std::vector<std::string>& sets) {
  std::vector<std::string> arguments{"--config", plan.config.string()};
  add_sets(sets, arguments);
  for (const auto& program : programs) core::ok_or_throw(processes.start(program, arguments));
}

void say_where_to_watch(Supervisor& supervisor, Processes& processes, const RunOptions& options) {
  if (!supervisor.picture().gone("monitor")) {
    const auto page = supervisor.command(processes, "monitor", "address", "", kAnswerS);
    if (page.ok()) {
      std::cout << "watch it on " << page.value() << std::endl;
      return;
    }
  }
  std::cerr << "railfix: the run goes on without the monitor; why stands in "
            << (options.out / "log" / "monitor.log").string() << '\n';
}

const char* source_of(const RunPlan& plan) {
  return plan.has_camera ? "frame_grabber" : "sensor_gateway";
}

// Until the data has ended or was interrupted. Error: a service has died or is silent.
core::Status watch(Supervisor& supervisor, Processes& processes, const RunPlan& plan, const RunOptions& options) {
  LiveTable table;
  Progress progress("run", plan.pictures.value_or(0), !plan.lossless);
  std::optional<std::string> ended;
  while (!ended && !supervisor.drained(source_of(plan)) && interrupted == 0) {
    supervisor.turn(kTurnS);
    ended = processes.unexpected_end();
    if (!plan.lossless) table.update(supervisor.picture());
    progress.update(supervisor.picture().views);
  }
  progress.finish();
  table.finish(supervisor.picture());
  if (ended) return core::Error{*ended};
  const auto lost = supervisor.lost();
  if (lost.empty() || interrupted != 0) return {};
  return core::Error{core::joined(lost) +
                     " said nothing any more before the run ended: dead or frozen; what was said before stands in " +
                     (options.out / "log").string()};
}

// Nobody goes on from a run.
void remove_notes(const std::string& train_id) {
  service::CommonConfig common;
  common.train_id = train_id;
  for (const auto& name : service::service_names()) {
    std::error_code not_there;
    std::filesystem::remove(service::notes_path(common, name), not_there);
  }
}

// Of a run that has failed, too, which is told after.
void write_tables(const RunOptions& options, const core::Status& watched, const core::Status& stopped) {
  const auto tables = export_tables(options.out / "recording.mcap", options.out);
  if (tables.ok()) {
    for (const auto& problem : tables.value().problems) std::cerr << "railfix: " << problem << '\n';
  }
  std::string failed;
  for (const auto& status : {watched, stopped}) {
    if (!status.ok()) failed += (failed.empty() ? "" : "\n") + status.error().message;
  }
  if (failed.empty()) return core::ok_or_throw(tables.ok() ? core::Status() : tables.error());
  if (tables.ok())
    failed += std::string(failed.ends_with('\n') ? "" : "\n") + "what was recorded until then is in " +
              options.out.string() + ": recording.mcap and its tables";
  throw std::runtime_error(failed);
}

int run(const RunOptions& options) {
  check_settings(options);
  const auto plan = core::value_or_throw(plan_run(options));
  const auto programs = programs_for(plan, options);
  std::signal(SIGINT, [](int) { interrupted = 1; });
  std::signal(SIGTERM, [](int) { interrupted = 1; });

  messaging::ParticipantOptions network;
  network.train_id = plan.train_id;
  network.service = "run";
  network.domain = options.domain;
  Supervisor supervisor(network, needed_of(programs));
  Processes processes(options.out / "log");
  start_services(processes, programs, plan, options.sets);
  const auto connected = supervisor.wait_connected(processes, kConnectS);
  if (!connected.ok()) throw std::runtime_error(connected.error().message);
  say_where_to_watch(supervisor, processes, options);
  const auto started = supervisor.command(processes, source_of(plan), "start", "", kAnswerS);
  if (!started.ok()) throw std::runtime_error(started.error().message);
  const auto watched = watch(supervisor, processes, plan, options);
  const auto stopped = processes.stop_all(kStopS);
  remove_notes(plan.train_id);
  write_tables(options, watched, stopped);
  const bool whole = !supervisor.picture().recording_broke_off;
  if (!whole) {
    std::cerr << "railfix: the recorder stopped before the data ended, so that tables and recording.mcap are not of "
                 "the whole run; why stands in "
              << (options.out / "log" / "recorder.log").string() << '\n';
  }
  if (interrupted != 0)
    std::cout << "interrupted after " << supervisor.picture().views
              << (plan.pictures ? " of " + std::to_string(*plan.pictures) : std::string())
              << " pictures; the rest is missing in what follows\n";
  std::cout << "tables and recording.mcap are in " << options.out.string() << '\n';
  if (!options.draw.empty()) std::cout << draw_run(options, options.out / "recording.mcap", options.draw) << '\n';
  return interrupted == 0 && whole ? 0 : 1;
}

}  // namespace

void add_run(CLI::App& app, Action& chosen) {
  auto options = std::make_shared<RunOptions>();
  auto* command = app.add_subcommand("run", "Put a dataset, a video or a folder of pictures through the real services");
  command->footer(
      "Examples:\n"
      "  railfix run --dataset SEQ --start 1:250:+ --out OUT        a dataset with its map, as fast as the services "
      "can\n"
      "  railfix run --dataset SEQ --pace real --out OUT           at the recorded rate, with a live table; counts "
      "what is dropped\n"
      "  railfix run --dataset cab.mp4 --camera camera.yaml --out OUT --draw OUT/drawn\n"
      "OUT gets recording.mcap, the tables of the run (track_view.csv, odometry.csv, train_state.csv, tpr.csv, ...), "
      "the services'\n"
      "configuration (run.yaml) and logs (log/). `railfix evaluate` judges them against ground truth.");
  command
      ->add_option("--dataset,--pictures,--video", options->source,
                   "Dataset folder (EuRoC or KITTI), folder of pictures, or video file")
      ->required();
  command->add_option("--camera", options->camera,
                      "Calibration file (from `railfix calibrate`), when the source has none");
  command->add_option("--fps", options->fps, "Pictures a second, for folders and videos without times")
      ->check(number_between(0.01, 1000.0));
  command->add_option("--map", options->map, "Map (compiled, LandXML or OSM); the dataset's own when not given");
  command->add_option("--start", options->start, "EDGE:OFFSET[:+|-] where the train stands, or unknown");
  command
      ->add_option(
          "--pace", options->pace,
          "lossless: next picture when all have used the last; real: recorded rate, as always without pictures")
      ->check(CLI::IsMember({"real", "lossless"}))
      ->capture_default_str();
  command->add_option("--out", options->out, "Folder for the results, without a run in it")->required();
  command->add_option("--state", options->state,
                      "Folder of what a train keeps from trip to trip: this run begins with it and adds to it");
  command->add_flag("--camera-only", options->camera_only, "Leave out wheel, IMU and GNSS");
  command->add_option("--draw", options->draw, "Folder for the pictures with the rails drawn on them");
  command->add_flag("!--no-pictures", options->record_pictures, "Leave the pictures out of the recording");
  command->add_option("--config", options->config, "Services' settings (YAML) to begin with");
  command->add_option("--set", options->sets, "section.key=value, over everything else; may be repeated");
  command->add_option("--domain", options->domain, "DDS domain")->check(CLI::Range(0, 232))->capture_default_str();
  command->callback([options, &chosen] { chosen = [options] { return run(*options); }; });
}

}  // namespace railfix::tool
