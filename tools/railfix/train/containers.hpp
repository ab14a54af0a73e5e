// Services of a host as containers, by Podman or Docker: one description, from which the supervisor's command and the
// compose file are made.
#pragma once

#include <yaml-cpp/yaml.h>

#include <optional>
#include <string>
#include <vector>

#include "train/manifest.hpp"

namespace railfix::tool {

/// User and group of all services: shared memory works between equal users only. The images have it, too.
inline constexpr int kUserId = 990;
/// Where services run inside a container; every other path is read only there.
inline constexpr const char* kContainerHome = "/var/lib/railfix";

/// One process of a host.
struct HostedService {
  std::string name;
  std::string release;
  bool standby = false;
  int64_t strength = 0;  // 0 = no other one on this train
};

struct Container {
  std::string name;
  std::string image;
  std::string config;                  // file, the same inside and outside
  std::vector<std::string> arguments;  // of the service
  std::vector<std::string> volumes;
  std::vector<std::string> device_rules;
  std::vector<std::string> groups;
};

/// `track-detector` of `track_detector`: of programs, images and packages.
std::string dashed(std::string name);
/// `railfix/fusion:1.2.0`.
std::string image_of(const HostedService& service);

/// The service with its files in `folder` (a generation) and its own ones in `home`. Of the host's keys it sees its
/// own.
Container container_of(const Manifest& manifest, const TrainHost& host, const HostedService& service,
                       const std::string& folder, const std::string& home);
/// Stays in the foreground, says on its output what the service says, and passes SIGTERM on.
std::vector<std::string> run_command(const Container& container, const std::string& engine);
/// Removes what may be left of it, whether it runs or not.
std::vector<std::string> remove_command(const Container& container, const std::string& engine);
/// For a compose file; a subset that docker-compose 1.29 understands.
YAML::Node compose_service(const Container& container);

/// Absolute path of the engine that the manifest names, or else of podman, or else of docker. Error: it is not
/// installed.
core::Result<std::string> container_engine(const Manifest& manifest);
/// What exactly is behind an image's name now; nothing when this computer does not have it.
std::optional<std::string> image_id(const std::string& engine, const std::string& image);

/// Lets the service's image say what is wrong with a configuration.
std::vector<std::string> check_command(const Manifest& manifest, const TrainHost& host, const HostedService& service,
                                       const std::string& engine, const std::string& config);
/// Such an exit code is the engine's own: it could not run what it was to run.
inline bool is_engine_failure(int exit_code) {
  return exit_code >= 125 && exit_code <= 127;
}

/// Everything that keeps this computer from running the host's containers, a sentence each.
std::vector<std::string> container_problems(const Manifest& manifest, const TrainHost& host);

/// Gives a folder and the files in it to the services' user; makes the folder when it is not there. Error: not root.
core::Status hand_over(const std::filesystem::path& folder);

}  // namespace railfix::tool
