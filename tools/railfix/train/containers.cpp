#include "train/containers.hpp"

#include <unistd.h>

#include <algorithm>
#include <map>
#include <sstream>

#include "core/joined.hpp"
#include "messaging/security.hpp"
#include "service/service.hpp"
#include "train/render.hpp"
#include "train/run.hpp"
#include "train/setting_files.hpp"

namespace railfix::tool {
namespace {

namespace fs = std::filesystem;

constexpr int kStopS = 10;
constexpr int kOpenFiles = 4096;
constexpr int kThreads = 4096;  // of all services together; engines would ask for more than some hosts allow
constexpr const char* kIdlLabel = "org.railfix.idl";

std::string user() {
  return std::to_string(kUserId) + ":" + std::to_string(kUserId);
}

std::string last_line(const std::string& text) {
  return text.substr(text.rfind('\n') + 1);
}

// Cameras and serial sensors are the only things beside the network that a service touches.
void add_devices(const std::string& service, Container& container) {
  if (service != "frame_grabber" && service != "sensor_gateway") return;
  container.volumes.push_back("/dev:/dev");
  // Major numbers (Documentation/admin-guide/devices.txt): video4linux, USB, and serial lines of three kinds.
  for (const char* major : {"81", "189", "4", "166", "188"})
    container.device_rules.push_back(std::string("c ") + major + ":* rmw");
  container.groups = {"44", "20", "46"};  // Debian's video, dialout and plugdev
}

// Images of one train must have been made of the same topics, or their services do not hear each other.
void check_topics(const std::string& engine, const std::vector<std::string>& images,
                  std::vector<std::string>& problems) {
  std::map<std::string, std::string> of_hash;
  for (const auto& image : images) {
    const auto ran = run(
        {engine, "image", "inspect", "--format", std::string("{{index .Config.Labels \"") + kIdlLabel + "\"}}", image});
    if (ran.exit_code == 0) of_hash.emplace(last_line(ran.text), image);
  }
  if (of_hash.size() > 1)
    problems.push_back("images " + of_hash.begin()->second + " and " + of_hash.rbegin()->second +
                       " were made of different topics (label " + kIdlLabel +
                       "), their services would not hear each other; take releases that fit");
}

}  // namespace

std::string dashed(std::string name) {
  std::replace(name.begin(), name.end(), '_', '-');
  return name;
}

std::string image_of(const HostedService& service) {
  return "railfix/" + dashed(service.name) + ":" + service.release;
}

Container container_of(const Manifest& manifest, const TrainHost& host, const HostedService& service,
                       const std::string& folder, const std::string& home) {
  Container container;
  container.name = "railfix-" + manifest.train_id + "-" + host.name + "-" + dashed(service.name);
  container.image = image_of(service);
  container.config = folder + "/config.yaml";
  container.arguments = service_arguments(service);
  container.volumes.push_back(home + ":" + kContainerHome);
  const auto add = [&](const std::string& file) {
    container.volumes.push_back(folder + "/" + file + ":" + folder + "/" + file + ":ro");
  };
  add("config.yaml");
  for (const auto& file : {manifest.map, manifest.calibration, manifest.qos_profiles}) {
    if (!file.empty()) add(fs::path(file).filename());
  }
  if (manifest.security) {
    for (const auto& file : {std::string("ca.pem"), std::string("governance.p7s"), service.name + ".cert.pem",
                             service.name + ".key.pem", service.name + ".permissions.p7s"})
      add("security/" + file);
  }
  for (const auto& file : setting_files(manifest)) {
    if (file.service == service.name) add(file.on_host("").substr(1));
  }
  add_devices(service.name, container);
  return container;
}

std::vector<std::string> run_command(const Container& container, const std::string& engine) {
  const std::string files = std::to_string(kOpenFiles);
  const std::string threads = std::to_string(kThreads);
  // Fast DDS tells hosts by their addresses, and shares memory between equal users: the host's network and IPC.
  // The supervisor looks at the health itself, so the engine need not start a process for that every few seconds.
  std::vector<std::string> command{engine,
                                   "run",
                                   "--rm",
                                   "--pull=never",
                                   "--name=" + container.name,
                                   "--network=host",
                                   "--ipc=host",
                                   "--user=" + user(),
                                   "--read-only",
                                   "--cap-drop=ALL",
                                   "--security-opt=no-new-privileges",
                                   "--init",
                                   "--no-healthcheck",
                                   "--log-driver=none",
                                   "--stop-timeout=" + std::to_string(kStopS),
                                   "--ulimit=nofile=" + files + ":" + files,
                                   "--ulimit=nproc=" + threads + ":" + threads,
                                   "--ulimit=core=0:0",
                                   "--env=RAILFIX_CONFIG=" + container.config,
                                   std::string("--env=") + service::kEndedBefore,
                                   std::string("--env=") + messaging::kTrainFolder,
                                   "--workdir=" + std::string(kContainerHome),
                                   "--tmpfs=/tmp"};
  for (const auto& volume : container.volumes) command.push_back("--volume=" + volume);
  for (const auto& rule : container.device_rules) command.push_back("--device-cgroup-rule=" + rule);
  for (const auto& group : container.groups) command.push_back("--group-add=" + group);
  command.push_back(container.image);
  command.insert(command.end(), container.arguments.begin(), container.arguments.end());
  return command;
}

std::vector<std::string> remove_command(const Container& container, const std::string& engine) {
  return {engine, "rm", "--force", container.name};
}

YAML::Node compose_service(const Container& container) {
  YAML::Node one;
  one["image"] = container.image;
  one["container_name"] = container.name;
  one["command"] = container.arguments;
  one["environment"]["RAILFIX_CONFIG"] = container.config;
  one["network_mode"] = "host";
  one["ipc"] = "host";
  one["user"] = user();
  one["read_only"] = true;
  one["init"] = true;
  one["cap_drop"].push_back("ALL");
  one["security_opt"].push_back("no-new-privileges");
  one["ulimits"]["nofile"] = kOpenFiles;
  one["ulimits"]["nproc"] = kThreads;
  one["ulimits"]["core"] = 0;
  one["restart"] = "unless-stopped";
  one["stop_grace_period"] = std::to_string(kStopS) + "s";
  one["working_dir"] = kContainerHome;
  one["volumes"] = container.volumes;
  if (!container.device_rules.empty()) one["device_cgroup_rules"] = container.device_rules;
  if (!container.groups.empty()) one["group_add"] = container.groups;
  one["tmpfs"] = std::vector<std::string>{"/tmp"};
  return one;
}

core::Result<std::string> container_engine(const Manifest& manifest) {
  const char* path = std::getenv("PATH");
  for (const std::string name : {"podman", "docker"}) {
    if (!manifest.engine.empty() && manifest.engine != name) continue;
    std::istringstream folders(path == nullptr ? "/usr/bin" : path);
    for (std::string folder; std::getline(folders, folder, ':');) {
      const auto program = fs::path(folder) / name;
      if (access(program.c_str(), X_OK) == 0) return program.string();
    }
  }
  const std::string missing = manifest.engine.empty() ? "neither podman nor docker" : "no " + manifest.engine;
  return core::Error{missing + " is installed; apt-get install " +
                     (manifest.engine == "docker" ? "docker.io" : "podman catatonit") +
                     ", or set train.run_as to programs"};
}

std::optional<std::string> image_id(const std::string& engine, const std::string& image) {
  const auto ran = run({engine, "image", "inspect", "--format", "{{.Id}}", image});
  return ran.exit_code == 0 ? std::optional(last_line(ran.text)) : std::nullopt;
}

std::vector<std::string> check_command(const Manifest& manifest, const TrainHost& host, const HostedService& service,
                                       const std::string& engine, const std::string& config) {
  Container check;
  check.name = "railfix-" + manifest.train_id + "-" + host.name + "-" + dashed(service.name) + "-check-" +
               std::to_string(getpid());
  check.image = image_of(service);
  check.config = config;
  check.arguments = {"--check"};
  check.volumes = {config + ":" + config + ":ro"};
  return run_command(check, engine);
}

std::vector<std::string> container_problems(const Manifest& manifest, const TrainHost& host) {
  const auto engine = container_engine(manifest);
  if (!engine.ok()) return {engine.error().message};
  if (geteuid() != 0) return {"containers of a train are started by root: use sudo"};
  if (const auto answer = run({engine.value(), "info"}); answer.exit_code != 0)
    return {engine.value() + " does not work here: " + last_line(answer.text)};
  std::vector<std::string> images;
  std::vector<std::string> missing;
  for (const auto& service : services_on(manifest, host.name)) {
    const auto image = image_of(service);
    (image_id(engine.value(), image) ? images : missing).push_back(image);
  }
  if (!missing.empty())
    return {"not on this computer: " + std::string(missing.size() == 1 ? "image " : "images ") + core::joined(missing) +
            "; " + engine.value() + " load --input the release's archive brings them (./dev images builds them), or " +
            "set train.run_as to programs, which the package railfix-RELEASE has"};
  if (images.empty()) return {};
  std::vector<std::string> problems;
  check_topics(engine.value(), images, problems);
  // One of them with everything that can go wrong with an engine: init, limits, capabilities.
  Container trial;
  trial.name = "railfix-" + manifest.train_id + "-" + host.name + "-trial-" + std::to_string(getpid());
  trial.image = images.front();
  trial.arguments = {"--version"};
  const auto ran = run(run_command(trial, engine.value()));
  if (ran.exit_code != 0)
    problems.push_back(engine.value() + " cannot run a container of " + trial.image + ": " + last_line(ran.text));
  return problems;
}

core::Status hand_over(const fs::path& folder) {
  std::error_code failed;
  fs::create_directories(folder, failed);
  bool done = chown(folder.c_str(), kUserId, kUserId) == 0;
  for (const auto& entry : fs::directory_iterator(folder, failed))
    done = lchown(entry.path().c_str(), kUserId, kUserId) == 0 && done;
  if (done && !failed) return {};
  return core::Error{folder.string() + " cannot be given to user " + std::to_string(kUserId) + "; are you root?"};
}

}  // namespace railfix::tool
