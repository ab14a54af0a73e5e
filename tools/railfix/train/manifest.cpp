#include "train/manifest.hpp"

#include <arpa/inet.h>

#include <algorithm>
#include <initializer_list>

#include "core/joined.hpp"
#include "core/shell_word.hpp"
#include "core/similar_names.hpp"
#include "messaging/network.hpp"
#include "service/service.hpp"
#include "service/yaml_file.hpp"

namespace railfix::tool {
namespace {

using service::is_name;

// Of "fusion.use_wheel"; 0 = it is not there.
int line_of(const YAML::Node& section, const std::string& key) {
  if (!section || !section.IsMap()) return 0;
  const size_t dot = key.find('.');
  for (const auto& entry : section) {
    if (entry.first.Scalar() != key.substr(0, dot)) continue;
    return dot == std::string::npos ? entry.first.Mark().line + 1 : line_of(entry.second, key.substr(dot + 1));
  }
  return 0;
}

class ManifestReader {
 public:
  ManifestReader(std::filesystem::path file, Manifest& manifest) : file_(std::move(file)), manifest_(manifest) {}

  void read(const YAML::Node& root) {
    if (!root.IsMap()) return problem(root, "train.yaml", "must have the sections train and settings");
    refuse_unknown(root, "", {"train", "settings"});
    const auto train = root["train"];
    if (!train || !train.IsMap()) return problem(root, "train", "is missing: who the train is, its hosts and services");
    refuse_unknown(
        train, "train.",
        {"id", "domain", "release", "run_as", "security", "map", "calibration", "qos_profiles", "hosts", "services"});
    read_train(train);
    read_hosts(train["hosts"], train);
    read_services(train["services"], train);
    manifest_.settings = root["settings"] ? root["settings"] : YAML::Node(YAML::NodeType::Map);
    check_settings(root["settings"]);
  }
  [[nodiscard]] const std::string& problems() const { return problems_; }

 private:
  void problem(const YAML::Node& node, const std::string& key, const std::string& reason) {
    const auto mark = node.Mark();
    problems_ += (problems_.empty() ? "" : "\n") + file_.string();
    if (!mark.is_null()) problems_ += " line " + std::to_string(mark.line + 1);
    problems_ += ": " + key + " " + reason;
  }

  void refuse_unknown(const YAML::Node& section, const std::string& path, const std::vector<std::string>& known) {
    for (const auto& entry : section) {
      const std::string key = entry.first.Scalar();
      if (std::find(known.begin(), known.end(), key) == known.end())
        problem(entry.first, path + key, "is not known here; " + core::did_you_mean(key, known));
    }
  }

  std::string text_of(const YAML::Node& node, const std::string& key) {
    if (!node) return "";
    if (node.IsNull()) return "";
    if (!node.IsScalar()) {
      problem(node, key, "must be a single value");
      return "";
    }
    return node.Scalar();
  }

  void read_train(const YAML::Node& train) {
    manifest_.train_id = text_of(train["id"], "train.id");
    if (!is_name(manifest_.train_id))
      problem(train, "train.id", "must be a name of letters, digits, '-', '_' and '.', such as re460-042");
    manifest_.release = text_of(train["release"], "train.release");
    if (!is_name(manifest_.release))
      problem(train, "train.release",
              std::string(manifest_.release.empty() ? "is missing" : "is none") +
                  ": the release that the train runs, such as 0.1.0");
    manifest_.map = text_of(train["map"], "train.map");
    manifest_.calibration = text_of(train["calibration"], "train.calibration");
    manifest_.qos_profiles = text_of(train["qos_profiles"], "train.qos_profiles");
    if (const std::string how = text_of(train["run_as"], "train.run_as"); how == "programs") {
      manifest_.containers = false;
    } else if (how == "podman" || how == "docker") {
      manifest_.engine = how;
    } else if (!how.empty() && how != "containers") {
      problem(train["run_as"], "train.run_as", "must be containers, podman, docker or programs");
    }
    if (const auto domain = train["domain"]; domain && (!YAML::convert<int64_t>::decode(domain, manifest_.domain) ||
                                                        manifest_.domain < 0 || manifest_.domain > 232))
      problem(domain, "train.domain", "must be a whole number from 0 to 232");
    if (const auto security = train["security"]; security && !YAML::convert<bool>::decode(security, manifest_.security))
      problem(security, "train.security", "'" + text_of(security, "train.security") + "' is not true or false");
  }

  void read_hosts(const YAML::Node& hosts, const YAML::Node& train) {
    if (!hosts || !hosts.IsMap() || hosts.size() == 0)
      return problem(train, "train.hosts", "is missing: the computers of the train, each with its address");
    for (const auto& entry : hosts) {
      const std::string path = "train.hosts." + entry.first.Scalar();
      TrainHost host;
      host.name = entry.first.Scalar();
      if (!is_name(host.name)) problem(entry.first, path, "is no name of letters, digits, '-', '_' and '.'");
      if (!entry.second.IsMap()) {
        problem(entry.first, path, "needs {address: IPv4 address on the train network}");
        continue;
      }
      refuse_unknown(entry.second, path + ".", {"address", "interface"});
      host.address = text_of(entry.second["address"], path + ".address");
      host.interface = text_of(entry.second["interface"], path + ".interface");
      in_addr parsed{};
      if (inet_pton(AF_INET, host.address.c_str(), &parsed) != 1)
        problem(entry.first, path + ".address", "'" + host.address + "' is not an IPv4 address such as 10.42.1.11");
      for (const auto& other : manifest_.hosts) {
        if (other.address == host.address)
          problem(entry.first, path + ".address", host.address + " is the address of " + other.name + ", too");
      }
      manifest_.hosts.push_back(host);
    }
  }

  void read_services(const YAML::Node& services, const YAML::Node& train) {
    if (!services || !services.IsMap() || services.size() == 0)
      return problem(train, "train.services", "is missing: which service runs on which host");
    refuse_unknown(services, "train.services.", service::service_names());
    for (const auto& name : service::service_names()) {
      const auto node = services[name];
      if (!node) continue;
      TrainService service;
      service.name = name;
      const std::string path = "train.services." + name;
      if (node.IsScalar()) {
        service.host = node.Scalar();
      } else if (node.IsMap()) {
        refuse_unknown(node, path + ".", {"host", "standby", "release"});
        service.host = text_of(node["host"], path + ".host");
        service.standby = text_of(node["standby"], path + ".standby");
        service.release = text_of(node["release"], path + ".release");
      }
      check_service(service, node, path);
      manifest_.services.push_back(service);
    }
  }

  void check_service(const TrainService& service, const YAML::Node& node, const std::string& path) {
    std::vector<std::string> hosts;
    for (const auto& host : manifest_.hosts) hosts.push_back(host.name);
    const auto known = [&](const std::string& host) {
      return std::find(hosts.begin(), hosts.end(), host) != hosts.end();
    };
    if (!known(service.host))
      problem(
          node, path,
          "runs on '" + service.host + "', which is no host of this train; " + core::did_you_mean(service.host, hosts));
    if (service.standby.empty()) return;
    if (!may_stand_by(service.name))
      problem(node, path + ".standby", "is not possible; only fusion and tpr_publisher can wait on another host");
    else if (!known(service.standby))
      problem(node, path + ".standby",
              "is '" + service.standby + "', which is no host of this train; " +
                  core::did_you_mean(service.standby, hosts));
    else if (service.standby == service.host)
      problem(node, path + ".standby", "is the same host; a standby on it would fail together with the first");
  }

  void check_settings(const YAML::Node& settings) {
    if (!settings) return;
    if (!settings.IsMap()) return problem(settings, "settings", "must consist of sections, one for each service");
    auto known = service::service_names();
    known.insert(known.begin(), "common");
    refuse_unknown(settings, "settings.", known);
    for (const auto& section : settings) {
      if (!section.second.IsMap() && !section.second.IsNull())
        problem(section.second, "settings." + section.first.Scalar(),
                "must be a section of keys, such as {key: value}");
    }
    if (!settings["common"] || !settings["common"].IsMap()) return;
    for (const char* key : {"train_id", "host", "domain", "interfaces", "peers", "ownership_strength", "qos_profiles",
                            "security", "lock_step"}) {
      if (settings["common"][key])
        problem(settings["common"][key], std::string("settings.common.") + key,
                "is made from the section train; leave it out");
    }
  }

  std::filesystem::path file_;
  Manifest& manifest_;
  std::string problems_;
};

}  // namespace

const TrainHost* Manifest::host(const std::string& name) const {
  const auto found = std::find_if(hosts.begin(), hosts.end(), [&](const auto& host) { return host.name == name; });
  return found == hosts.end() ? nullptr : &*found;
}

const TrainHost* Manifest::host_here() const {
  const TrainHost* here = nullptr;
  for (const auto& host : hosts) {
    if (!messaging::addresses_of({host.address}).ok()) continue;
    if (here != nullptr) return nullptr;
    here = &host;
  }
  return here;
}

std::string Manifest::why_no_host_here() const {
  return "this computer has " + messaging::interfaces_told() + "; the manifest has " +
         core::joined(hosts, [](const auto& host) { return host.name + " " + host.address; }) +
         ": correct `address`, or say with --host which of them this computer is";
}

const TrainService* Manifest::service(const std::string& name) const {
  const auto found = std::find_if(services.begin(), services.end(), [&](const auto& one) { return one.name == name; });
  return found == services.end() ? nullptr : &*found;
}

std::string with_own_lines(const Manifest& manifest, std::string said, const std::string& rendered,
                           const std::string& otherwise) {
  constexpr std::string_view kLine = " line ";
  for (size_t at = 0; (at = said.find(rendered, at)) != std::string::npos;) {
    size_t end = at + rendered.size();
    std::string place = otherwise;
    if (said.compare(end, kLine.size(), kLine) == 0) {
      end = std::min(said.find(": ", end), said.size());
      const auto key = said.substr(std::min(end + 2, said.size()));
      if (const auto line = line_of(manifest.settings, key.substr(0, key.find(' '))); line > 0)
        place = (manifest.folder / "train.yaml").string() + std::string(kLine) + std::to_string(line);
    }
    said.replace(at, end - at, place);
    at += place.size();
  }
  return said;
}

std::string Manifest::typed() const {
  return core::shell_word(folder.string());
}

std::string Manifest::release_of(const TrainService& service) const {
  return service.release.empty() ? release : service.release;
}

bool may_stand_by(const std::string& service) {
  return service == "fusion" || service == "tpr_publisher";
}

core::Result<Manifest> read_manifest(const std::filesystem::path& train) {
  const auto file = std::filesystem::is_directory(train) ? train / "train.yaml" : train;
  Manifest manifest;
  manifest.folder = std::filesystem::absolute(file).lexically_normal().parent_path();
  const auto root = service::read_yaml(file, "give the train's folder, such as deploy/trains/re460-042");
  if (!root.ok()) return root.error();
  ManifestReader reader(file, manifest);
  try {
    reader.read(root.value());
  } catch (const YAML::Exception& error) {  // a node that is of another kind than asked for
    return core::Error{file.string() + " line " + std::to_string(error.mark.line + 1) + ": " + error.msg};
  }
  if (!reader.problems().empty()) return core::Error{reader.problems()};
  return manifest;
}

}  // namespace railfix::tool
