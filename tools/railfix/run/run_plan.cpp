#include "run/run_plan.hpp"

#include <unistd.h>
#include <yaml-cpp/yaml.h>

#include <map>
#include <sstream>

#include "core/whole_file.hpp"
#include "dataset/dataset.hpp"
#include "service/yaml_file.hpp"
#include "track/import/build.hpp"
#include "track/map.hpp"

namespace railfix::tool {
namespace {

constexpr const char* kConfigFile = "run.yaml";
constexpr double kKeepFreeMb = 50;
constexpr double kBytesPerMb = 1e6;

core::Result<std::filesystem::path> prepare_map(const RunOptions& options) {
  std::filesystem::path source = options.map;
  if (source.empty()) {
    const auto found = dataset::find_map(options.source);
    if (!found) return std::filesystem::path();
    source = *found;
  }
  if (!std::filesystem::exists(source)) return core::Error{source.string() + " does not exist; --map needs a map file"};
  if (track::Map::load(source).ok()) return std::filesystem::absolute(source);
  const auto built = track::build_map({source}, {});
  if (!built.ok()) return built.error();
  const auto compiled = std::filesystem::absolute(options.out / "line.map");
  const auto saved = built.value().map.save(compiled);
  if (!saved.ok()) return saved.error();
  return compiled;
}

// Said here in one sentence, before anything starts, and not by a service that ends.
core::Status check_start(const RunOptions& options, const std::filesystem::path& map) {
  if (options.start == "unknown") return {};
  if (map.empty()) {
    return core::Error{"--start " + options.start + " needs a map: give --map, or put one into " +
                       (options.source / "map").string()};
  }
  const auto loaded = track::Map::load(map);
  if (!loaded.ok()) return loaded.error();
  const auto place = loaded.value().parse_position(options.start);
  return place.ok() ? core::Status() : core::Status(core::Error{"--start: " + place.error().message});
}

core::Result<YAML::Node> load_settings(const std::filesystem::path& file) {
  if (file.empty()) return YAML::Node(YAML::NodeType::Map);
  auto settings = service::read_yaml(file, "--config needs a YAML file");
  if (settings.ok() && !settings.value().IsMap())
    return core::Error{file.string() + " must consist of sections, one for each service"};
  return settings;
}

void fill_grabber(YAML::Node grabber, const RunOptions& options) {
  grabber["source"] = std::filesystem::absolute(options.source).string();
  grabber["calibration"] = options.camera.empty() ? "" : std::filesystem::absolute(options.camera).string();
  grabber["fps"] = options.fps;
  grabber["pace"] = options.pace;
  grabber["start"] = "command";
  if (options.pace != "lossless") return;
  for (const char* service :
       {"sensor_gateway", "track_detector", "odometry", "map_matcher", "fusion", "tpr_publisher"}) {
    grabber["wait_for"].push_back(service);
  }
}

bool records_pictures(const YAML::Node& recorder) {
  const auto is_of_pictures = [](const YAML::Node& topic) {
    const auto name = topic.as<std::string>("");
    return name == "camera_frame" || name.starts_with("camera_frame/");
  };
  const YAML::Node left_out = recorder["leave_out"];
  const bool leaves_out =
      left_out && left_out.IsSequence() && std::any_of(left_out.begin(), left_out.end(), is_of_pictures);
  return recorder["pictures"].as<std::string>("jpeg") != "none" && !leaves_out;
}

// With everything that the user has set. A run takes the next picture when this one is recorded, too.
core::Status fill_recorder_in(YAML::Node& settings, const RunPlan& plan) {
  const YAML::Node recorder = settings["recorder"];
  if (!recorder["autostart"].as<bool>(true))
    return core::Error{"recorder.autostart: a run records from its beginning; leave it out"};
  if (plan.lossless && records_pictures(recorder)) settings["frame_grabber"]["wait_for"].push_back("recorder");
  return {};
}

// What only the run knows; the rest of each section stays as the user or the default has it.
void fill_settings(YAML::Node& settings, const RunOptions& options, const RunPlan& plan) {
  settings["common"]["train_id"] = plan.train_id;
  settings["common"]["domain"] = options.domain;
  settings["common"]["lock_step"] = plan.lossless;
  if (plan.has_camera) fill_grabber(settings["frame_grabber"], options);

  YAML::Node gateway = settings["sensor_gateway"];
  gateway["source"] = std::filesystem::absolute(options.source).string();
  gateway["clock"] = plan.has_camera ? "follow" : "own";
  if (!plan.has_camera) gateway["start"] = "command";
  if (options.camera_only) {
    for (const char* sensor : {"imu", "wheel", "gnss"}) gateway[sensor] = false;
  }

  for (const char* service : {"fusion", "map_matcher", "tpr_publisher"}) settings[service]["map"] = plan.map.string();
  settings["fusion"]["start"] = options.start;
  if (!options.state.empty()) {
    settings["fusion"]["scales_file"] = std::filesystem::absolute(options.state / "scales.yaml").string();
  }
  for (const char* service : {"recorder", "monitor"}) settings[service]["map"] = plan.map.string();
  settings["recorder"]["train_file"] = plan.config.string();
  settings["recorder"]["file"] = std::filesystem::absolute(options.out / "recording.mcap").string();
  if (!options.record_pictures) settings["recorder"]["pictures"] = "none";
  // A folder that somebody has chosen, not the disk of a train.
  if (!settings["recorder"]["keep_free_mb"]) settings["recorder"]["keep_free_mb"] = kKeepFreeMb;
}

// The recorder leaves so much free, and a run that records nothing is none.
core::Status check_room(const YAML::Node& settings, const std::filesystem::path& folder) {
  std::error_code failed;
  const auto space = std::filesystem::space(folder, failed);
  const double keep_mb = settings["recorder"]["keep_free_mb"].as<double>(kKeepFreeMb);
  if (failed || static_cast<double>(space.available) >= keep_mb * kBytesPerMb) return {};
  return core::Error{folder.string() + ": nothing would be recorded, its disk has only " +
                     std::to_string(space.available / static_cast<uintmax_t>(kBytesPerMb)) +
                     " MB free; give another folder, or a smaller recorder.keep_free_mb than " +
                     std::to_string(static_cast<int64_t>(keep_mb))};
}

// What is set on the command line is part of the run's configuration. What cannot be meant the services refuse.
void add_overrides(YAML::Node& settings, const std::vector<std::string>& sets) {
  for (const std::string& set : sets) {
    const size_t equals = set.find('=');
    if (equals == std::string::npos || set.find('.') >= equals) continue;
    try {
      const YAML::Node value = service::value_of_set(set.substr(equals + 1));
      YAML::Node section = settings;
      std::string key = set.substr(0, equals);
      for (size_t dot = key.find('.'); dot != std::string::npos; dot = key.find('.')) {
        section.reset(section[key.substr(0, dot)]);
        key.erase(0, dot + 1);
      }
      section[key] = value;
    } catch (const YAML::Exception&) {
      continue;
    }
  }
}

// The run must find its services where it looks for them.
core::Status check_overrides(const std::vector<std::string>& sets) {
  const std::map<std::string, std::string> own{{"common.domain", "is set with --domain"},
                                               {"common.train_id", "is the run's own"},
                                               {"common.lock_step", "is set with --pace"}};
  for (const std::string& set : sets) {
    const auto found = own.find(set.substr(0, set.find('=')));
    if (found != own.end()) return core::Error{"--set " + set + ": " + found->first + " " + found->second};
  }
  return {};
}

core::Status check_drawing(const RunOptions& options) {
  for (const char* pictures : {"", "data", "cam0/data", "mav0/cam0/data", "image_0"}) {
    std::error_code failed;
    if (!options.draw.empty() && std::filesystem::equivalent(options.draw, options.source / pictures, failed))
      return core::Error{"--draw " + options.draw.string() +
                         " is the folder of the pictures themselves; give another folder"};
  }
  return {};
}

core::Status check_without_camera(const RunOptions& options) {
  const std::string why = options.source.string() + " has no pictures: ";
  if (!options.draw.empty()) return core::Error{why + "there is nothing that --draw could draw on; leave it out"};
  if (options.camera_only) return core::Error{why + "nothing is left with --camera-only; leave it out"};
  return {};
}

// Its recording would be lost, and what a broken run leaves would be judged with its tables.
core::Status check_unused(const std::filesystem::path& folder) {
  if (!std::filesystem::exists(folder / kConfigFile)) return {};
  return core::Error{folder.string() + " holds a run already; remove it, or give another --out"};
}

/// The rest of the plan, in folders that are there.
core::Status plan_in_folder(const RunOptions& options, RunPlan& plan) {
  auto lock = FolderLock::take(options.out);
  if (!lock.ok()) return core::Error{"--out: " + lock.error().message};
  plan.lock = std::move(lock).value();
  if (const auto unused = check_unused(options.out); !unused.ok()) return unused.error();
  plan.train_id = "run-" + std::to_string(getpid());
  const auto map = prepare_map(options);
  if (!map.ok()) return map.error();
  plan.map = map.value();
  if (const auto start = check_start(options, plan.map); !start.ok()) return start.error();

  auto settings = load_settings(options.config);
  if (!settings.ok()) return settings.error();
  plan.config = std::filesystem::absolute(options.out / kConfigFile);
  fill_settings(settings.value(), options, plan);
  add_overrides(settings.value(), options.sets);
  if (const auto filled = fill_recorder_in(settings.value(), plan); !filled.ok()) return filled.error();
  if (const auto room = check_room(settings.value(), options.out); !room.ok()) return room.error();
  std::ostringstream text;
  text << settings.value() << '\n';
  return core::write_whole(plan.config, text.str());
}

}  // namespace

bool is_of_camera(const std::string& service) {
  return service == "frame_grabber" || service == "track_detector" || service == "odometry";
}

core::Result<RunPlan> plan_run(const RunOptions& options) {
  if (const auto checked = check_overrides(options.sets); !checked.ok()) return checked.error();
  if (const auto checked = check_drawing(options); !checked.ok()) return checked.error();
  RunPlan plan;
  plan.has_camera = !dataset::has_sensors_alone(options.source);
  plan.lossless = plan.has_camera && options.pace == "lossless";
  if (plan.has_camera) {
    const auto pictures = dataset::open_pictures(options.source, {options.fps});
    if (!pictures.ok()) return pictures.error();
    plan.pictures = pictures.value()->count();
  } else if (const auto checked = check_without_camera(options); !checked.ok()) {
    return checked.error();
  }

  std::vector<std::filesystem::path> made;
  const auto given_up = [&](const core::Error& why) {
    for (const auto& folder : made) {
      std::error_code ignored;  // one that stays does no harm
      std::filesystem::remove_all(folder, ignored);
    }
    return why;
  };
  for (const auto& folder : {options.out, options.state, options.draw}) {
    std::error_code failed;
    if (!folder.empty() && std::filesystem::create_directories(folder, failed)) made.push_back(folder);
    if (failed) return given_up({folder.string() + " cannot be made: " + failed.message()});
  }
  if (const auto planned = plan_in_folder(options, plan); !planned.ok()) return given_up(planned.error());
  return plan;
}

}  // namespace railfix::tool
