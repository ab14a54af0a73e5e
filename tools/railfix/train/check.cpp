#include "train/check.hpp"

#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <future>

#include "core/whole_file.hpp"
#include "dataset/calibration.hpp"
#include "ground_link/mqtt_client.hpp"
#include "messaging/qos_match.hpp"
#include "track/map.hpp"
#include "train/findings.hpp"
#include "train/made_of.hpp"
#include "train/render.hpp"
#include "train/run.hpp"
#include "train/setting_files.hpp"

namespace railfix::tool {
namespace {

namespace fs = std::filesystem;

// As in deploy/trains.
constexpr const char* kExamplePassword = "the-password-of-this-train-at-the-broker";
constexpr const char* kExampleWord = "a-word-of-your-own";

// Full pictures stay in the memory of one host.
void check_placement(const Manifest& manifest, Findings& findings) {
  const auto* camera = manifest.service("frame_grabber");
  for (const char* reader : {"track_detector", "odometry"}) {
    const auto* service = manifest.service(reader);
    if (service == nullptr) continue;
    if (camera == nullptr)
      error(findings, std::string(reader) + " has no pictures: train.services has no frame_grabber");
    else if (service->host != camera->host)
      error(findings, std::string(reader) + " is on " + service->host +
                          ", but full pictures do not leave the camera's host " + camera->host + "; put it there");
  }
  const auto needs = [&](const char* service, const char* other) {
    if (manifest.service(service) != nullptr && manifest.service(other) == nullptr)
      warning(findings, std::string(service) + " runs without " + other + ", which it listens to");
  };
  needs("tpr_publisher", "fusion");
  needs("fusion", "odometry");
  needs("map_matcher", "odometry");
}

// A place that fusion does not find on its map ends it at every start.
void check_start(const Manifest& manifest, const track::Map* map, Findings& findings) {
  const auto start = setting_of(manifest.settings, "fusion", "start");
  const bool other_map = !setting_of(manifest.settings, "fusion", "map").empty();  // which only the hosts have
  if (manifest.service("fusion") == nullptr || start.empty() || start == "unknown" || other_map) return;
  if (manifest.map.empty())
    return error(findings, "settings.fusion.start is " + start +
                               ", a place on a map, but train.map is empty; name a map there, or leave start out");
  if (map == nullptr) return;  // told already
  if (const auto place = map->parse_position(start); !place.ok())
    error(findings,
          "settings.fusion.start: " + place.error().message + "; leave it out, and map_matcher finds the place");
}

// A copy that was cut short would end every service that reads it.
void check_contents(const Manifest& manifest, Findings& findings) {
  const auto is_there = [&](const std::string& name) {
    return !name.empty() && access((manifest.folder / name).c_str(), R_OK) == 0;
  };
  std::optional<track::Map> map;
  if (is_there(manifest.map)) {
    auto loaded = track::Map::load(manifest.folder / manifest.map);
    if (!loaded.ok()) error(findings, "train.map: " + loaded.error().message);
    if (loaded.ok()) map = std::move(loaded).value();
  }
  check_start(manifest, map ? &*map : nullptr, findings);
  if (is_there(manifest.calibration)) {
    if (const auto camera = dataset::read_calibration(manifest.folder / manifest.calibration); !camera.ok())
      error(findings, "train.calibration: " + camera.error().message);
  }
  for (const auto& file : setting_files(manifest)) {
    if (file.key != "ground_link.password_file" || !is_there(file.file.string())) continue;
    if (const auto password = ground_link::read_password(manifest.folder / file.file); !password.ok())
      error(findings, "settings." + file.service + "." + file.key + ": " + password.error().message);
  }
}

void check_files(const Manifest& manifest, Findings& findings) {
  for (const auto& [key, name] : {std::pair<std::string, std::string>{"train.map", manifest.map},
                                  std::pair<std::string, std::string>{"train.calibration", manifest.calibration},
                                  std::pair<std::string, std::string>{"train.qos_profiles", manifest.qos_profiles}}) {
    if (!name.empty() && access((manifest.folder / name).c_str(), R_OK) != 0)
      error(findings,
            key + ": " + (manifest.folder / name).string() + " is missing or cannot be read; put it beside train.yaml");
  }
  for (const auto& file : setting_files(manifest)) {
    if (access((manifest.folder / file.file).c_str(), R_OK) != 0)
      error(findings, "settings." + file.service + "." + file.key + ": " + (manifest.folder / file.file).string() +
                          " is missing or cannot be read; put it beside train.yaml");
  }
  if (manifest.map.empty()) warning(findings, "train.map is empty: there will be distance and speed, but no position");
}

void check_quality_of_service(const Manifest& manifest, Findings& findings) {
  const auto file = manifest.folder / manifest.qos_profiles;
  if (manifest.qos_profiles.empty() || access(file.c_str(), R_OK) != 0) return;
  const auto mismatches = messaging::qos_mismatches(file);
  if (!mismatches.ok()) return error(findings, mismatches.error().message);
  for (const auto& mismatch : mismatches.value()) error(findings, mismatch);
}

// Reports leave a train that locks everything else in.
void check_ground_link(const Manifest& manifest, Findings& findings) {
  const auto link = [&](const char* key) {
    return setting_of(manifest.settings, "tpr_publisher", std::string("ground_link.") + key);
  };
  if (manifest.service("tpr_publisher") == nullptr || link("broker").empty()) return;
  const std::string broker = "settings.tpr_publisher.ground_link: reports go to " + link("broker");
  if (!manifest.security) {
    if (!link("password_file").empty() && link("ca_file").empty())
      warning(findings, broker +
                            " with a password in plain text; set ca_file to the broker's authority, and the "
                            "broker's port for TLS (8883)");
    return;
  }
  if (link("ca_file").empty())
    warning(findings, broker +
                          " without TLS: who is on the way reads and changes them; set ca_file to the broker's "
                          "authority, and the broker's port for TLS (8883)");
  if (link("user").empty() && link("certificate_file").empty())
    warning(findings, broker +
                          " without a name: the broker cannot tell this train from another one; set user and "
                          "password_file, or certificate_file and key_file");
}

// Copied from an example and never filled in. Everybody can read these words.
void check_placeholders(const Manifest& manifest, Findings& findings) {
  const auto broker = setting_of(manifest.settings, "tpr_publisher", "ground_link.broker");
  if (broker.substr(0, broker.rfind(':')).ends_with(".example"))
    warning(findings, "settings.tpr_publisher.ground_link.broker: " + broker +
                          " is the example's, and no such broker is anywhere; give the address of yours");
  for (const auto& file : setting_files(manifest)) {
    const bool is_word = file.key == "token_file";
    if (!is_word && file.key != "ground_link.password_file") continue;
    const auto text = core::read_whole(manifest.folder / file.file);
    if (!text.ok()) continue;  // told already
    const auto word = text.value().substr(0, text.value().find('\n'));
    if (word != (is_word ? kExampleWord : kExamplePassword)) continue;
    warning(findings, "settings." + file.service + "." + file.key + ": " + (manifest.folder / file.file).string() +
                          " holds the example's " + (is_word ? "word" : "password") +
                          ", which everybody can read; put one of your own there");
  }
}

// A page that is not on this computer alone lets nobody control without a token.
void check_control(const Manifest& manifest, Findings& findings) {
  const auto of = [&](const char* key) { return setting_of(manifest.settings, "monitor", key); };
  const bool local = of("address").starts_with("127.") || of("address") == "localhost";
  if (manifest.service("monitor") == nullptr || of("control") == "false" || local) return;
  if (!of("token").empty() || !of("token_file").empty()) return;
  warning(findings,
          "settings.monitor: nobody can control recorder and player from the page, because there is no token; put a "
          "word into a file beside train.yaml and name it in token_file, or set control to false");
}

bool is_live_camera(const std::string& source) {
  return source.starts_with("genicam:") || source.starts_with("capture:");
}

// Nothing that was recorded lies beside a live camera: not even the focal length is known.
void check_calibration(const Manifest& manifest, Findings& findings) {
  const auto of = [&](const char* key) { return setting_of(manifest.settings, "frame_grabber", key); };
  if (manifest.service("frame_grabber") == nullptr || !is_live_camera(of("source"))) return;
  if (!manifest.calibration.empty() || !of("calibration").empty()) return;
  warning(findings,
          "train.calibration is empty: focal length and height of the camera are guessed, and no distance can be "
          "trusted; railfix calibrate lens, then mount, make the file");
}

// Settings that are right for a run of recorded data and wrong for a train.
void check_settings(const Manifest& manifest, Findings& findings) {
  for (const char* service : {"frame_grabber", "sensor_gateway"}) {
    if (manifest.service(service) != nullptr && setting_of(manifest.settings, service, "source").empty())
      error(findings, std::string("settings.") + service + ".source is not given, and " + service +
                          " does not start without; say where its data come from, or take it out of train.services");
  }
  if (const auto start = setting_of(manifest.settings, "fusion", "start"); !start.empty() && start != "unknown")
    warning(findings, "settings.fusion.start is " + start +
                          ": a train that was switched off elsewhere would believe to stand there; leave it out, "
                          "and map_matcher finds the place");
  if (setting_of(manifest.settings, "monitor", "address") == "0.0.0.0")
    warning(findings,
            "settings.monitor.address is 0.0.0.0: page and metrics are open to every network that the computer is in; "
            "leave it out, and they are on the train network only");
  check_calibration(manifest, findings);
  check_ground_link(manifest, findings);
  check_placeholders(manifest, findings);
  check_control(manifest, findings);
  const auto* camera = manifest.service("frame_grabber");
  const auto* recorder = manifest.service("recorder");
  if (camera != nullptr && recorder != nullptr && camera->host != recorder->host &&
      setting_of(manifest.settings, "recorder", "pictures") != "none")
    warning(findings, "recorder is on " + recorder->host + " and records no pictures: they do not leave " +
                          camera->host + "; put it there, or set settings.recorder.pictures to none");
}

void check_ports(const Manifest& manifest, Findings& findings) {
  for (const auto& host : manifest.hosts) {
    std::map<int64_t, std::string> taken;
    for (const auto& service : services_on(manifest, host.name)) {
      const auto section = manifest.settings[service.name];
      if (!section || !section.IsMap()) continue;
      for (const auto& entry : section) {
        const std::string key = entry.first.Scalar();
        int64_t port = 0;
        if (!key.ends_with("port") || !YAML::convert<int64_t>::decode(entry.second, port) || port == 0) continue;
        const std::string who = service.name + "." + key;
        const auto [other, is_new] = taken.emplace(port, who);
        if (!is_new)
          error(findings,
                who + " and " + other->second + " want the same port " + std::to_string(port) + " on " + host.name);
      }
    }
  }
}

// The way to let a service look at its settings on this computer: its image, for a train of containers, or its program.
// Nothing when there is neither.
std::optional<std::vector<std::string>> way_to_check(const Manifest& manifest, const TrainHost& host,
                                                     const HostedService& service, const FindProgram& find_program,
                                                     const std::string& config) {
  if (manifest.containers) {
    const auto engine = container_engine(manifest);
    if (engine.ok() && image_id(engine.value(), image_of(service)))
      return check_command(manifest, host, service, engine.value(), config);
  }
  const auto program = find_program(service);
  if (!program) return std::nullopt;
  return std::vector<std::string>{program->string(), "--check", "--config", config};
}

std::string missing_program(const Manifest& manifest, const HostedService& service) {
  if (!manifest.containers)
    return "its program of release " + service.release + " is not on this computer; check it on the train's hosts";
  return "its image " + image_of(service) + " is not on this computer" +
         (geteuid() == 0 ? "" : ", or only for root: use sudo") + "; check it on the train's hosts";
}

Finding not_checked(const HostedService& service, const std::string& why) {
  return {false, "settings of " + service.name + " are not checked: " + why};
}

// What the service says of its settings and of itself.
struct Answer {
  std::string service;
  std::optional<Finding> finding;  // nothing when its settings are right
  TopicLayouts made_of;
};

Answer ask_service(const Manifest& manifest, const TrainHost& host, const HostedService& service,
                   const FindProgram& find_program, const std::string& config) {
  const auto answer = [&](Finding finding) { return Answer{service.name, std::move(finding), {}}; };
  const auto command = way_to_check(manifest, host, service, find_program, config);
  if (!command) return answer(not_checked(service, missing_program(manifest, service)));
  auto [exit_code, text] = run(*command);
  if (exit_code == 0) return {service.name, std::nullopt, topic_layouts_in(text)};
  if (manifest.containers && is_engine_failure(exit_code))
    return answer(not_checked(service, "a container of " + image_of(service) + " cannot be run here: " + text));
  // The rendered file is ours; the operator knows train.yaml.
  text = with_own_lines(manifest, std::move(text), config, "settings for " + host.name);
  if (text.empty()) text = service.name + " does not accept its settings, and does not say why: " + command->front();
  return answer({true, text});
}

std::string folder_of_drafts() {
  const char* told = std::getenv("TMPDIR");
  return told == nullptr ? "/tmp" : std::string("TMPDIR (") + told + ")";
}

void check_services(const Manifest& manifest, const FindProgram& find_program, TrainCheck& check) {
  // Side by side: a container takes half a second.
  std::vector<std::future<Answer>> answers;
  std::vector<fs::path> configs;
  std::error_code failed;
  const auto folder = fs::temp_directory_path(failed);
  if (failed)
    return error(check.findings, "settings cannot be checked: " + folder_of_drafts() +
                                     " is no folder; set TMPDIR to one where you may write");
  for (const auto& host : manifest.hosts) {
    const auto& config =
        configs.emplace_back(folder / ("railfix-check-" + std::to_string(getpid()) + "-" + host.name + ".yaml"));
    const auto written = core::write_whole(config, render_config(manifest, host, manifest.folder.string()));
    if (!written.ok()) {
      error(check.findings, "settings for " + host.name + " cannot be checked: " + written.error().message +
                                "; TMPDIR names the folder");
      continue;
    }
    for (const auto& service : services_on(manifest, host.name)) {
      answers.push_back(
          std::async(std::launch::async, [&manifest, &host, &find_program, service, file = config.string()] {
            return ask_service(manifest, host, service, find_program, file);
          }));
    }
  }
  for (auto& asked : answers) {
    auto answer = asked.get();
    if (answer.finding) add_once(check.findings, *std::move(answer.finding));
    check.made_of[answer.service] = std::move(answer.made_of);
  }
  for (const auto& config : configs) fs::remove(config, failed);
}

void check_topics(const Manifest& manifest, TrainCheck& check) {
  std::vector<PlannedService> services;
  for (const auto& service : manifest.services) {
    PlannedService& one = services.emplace_back();
    one.name = service.name;
    one.release = manifest.release_of(service);
    one.made_of = check.made_of[service.name];
  }
  if (const auto found = misfit(services, services))
    error(check.findings, *found + ": they would not hear each other; take releases that fit");
}

}  // namespace

TrainCheck check_train(const Manifest& manifest, const FindProgram& find_program) {
  TrainCheck check;
  auto& findings = check.findings;
  check_placement(manifest, findings);
  check_files(manifest, findings);
  check_contents(manifest, findings);
  check_quality_of_service(manifest, findings);
  check_settings(manifest, findings);
  check_ports(manifest, findings);
  for (const auto& host : manifest.hosts) {
    for (auto& finding : check_certificates(manifest, host)) add_once(findings, std::move(finding));
  }
  check_services(manifest, find_program, check);
  check_topics(manifest, check);
  return check;
}

}  // namespace railfix::tool
