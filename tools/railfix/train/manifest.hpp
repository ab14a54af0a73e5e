// deploy/trains/<train>/train.yaml: the one file that an operator edits. Which hosts a train has, which service runs
// where, which map and calibration, and the services' settings.
#pragma once

#include <yaml-cpp/yaml.h>

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "core/result.hpp"

namespace railfix::tool {

struct TrainHost {
  std::string name;
  std::string address;    // IPv4, on the train network
  std::string interface;  // its name on that host; empty = found by the address
};

struct TrainService {
  std::string name;
  std::string host;
  std::string standby;  // host of the standby, empty = none
  std::string release;  // empty = the train's
};

struct Manifest {
  std::filesystem::path folder;  // of train.yaml; the files that it names lie beside it
  std::string train_id;
  int64_t domain = 0;
  std::string release;
  bool security = false;
  bool containers = true;  // false: services run as programs of the host
  std::string engine;      // of containers: podman or docker; empty = the first of them that is there
  std::vector<TrainHost> hosts;
  std::vector<TrainService> services;  // in the order of the data's way
  std::string map;                     // file names; empty = none
  std::string calibration;
  std::string qos_profiles;
  YAML::Node settings;  // the services' sections

  [[nodiscard]] const TrainHost* host(const std::string& name) const;
  /// The one whose interface or address this computer has; nullptr when there is none, or more than one.
  [[nodiscard]] const TrainHost* host_here() const;
  /// Why there is no host_here(), with the addresses of both sides, and what to do.
  [[nodiscard]] std::string why_no_host_here() const;
  [[nodiscard]] const TrainService* service(const std::string& name) const;
  [[nodiscard]] std::string release_of(const TrainService& service) const;
  /// Its folder as an operator types it.
  [[nodiscard]] std::string typed() const;
};

/// Services of which two may run, one waiting to take over.
bool may_stand_by(const std::string& service);

/// What is said of the settings in the file `rendered`, with the lines of train.yaml: "FILE line 3: fusion.key is
/// wrong". A setting that train.yaml has not is told of the file that `otherwise` names.
std::string with_own_lines(const Manifest& manifest, std::string said, const std::string& rendered,
                           const std::string& otherwise);

/// Reads FOLDER/train.yaml (or the file itself). Error: everything that is wrong with the text, a line each with file,
/// line, key and the way out.
core::Result<Manifest> read_manifest(const std::filesystem::path& train);

}  // namespace railfix::tool
