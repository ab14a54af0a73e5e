#include "train/render.hpp"

#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <sstream>

#include "core/fnv.hpp"
#include "core/whole_file.hpp"
#include "train/host_files.hpp"
#include "train/setting_files.hpp"

namespace railfix::tool {
namespace {

namespace fs = std::filesystem;

constexpr int kPrimaryStrength = 20;
constexpr int kStandbyStrength = 10;
constexpr const char* kMade = "Made by railfix train from train.yaml; edit that.";

void fill(YAML::Node section, const char* key, const std::string& value) {
  if (!value.empty() && !section[key]) section[key] = value;
}

std::string in_folder(const std::string& folder, const std::string& file) {
  return file.empty() ? "" : folder + "/" + fs::path(file).filename().string();
}

// What only the manifest knows.
void fill_common(YAML::Node settings, const Manifest& manifest, const TrainHost& host, const std::string& folder) {
  YAML::Node common = settings["common"];
  common["train_id"] = manifest.train_id;
  common["host"] = host.name;
  common["domain"] = manifest.domain;
  common["interfaces"].push_back(host.interface.empty() ? host.address : host.interface);
  for (const auto& other : manifest.hosts) {
    if (other.name != host.name) common["peers"].push_back(other.address);
  }
  if (!manifest.qos_profiles.empty()) common["qos_profiles"] = in_folder(folder, manifest.qos_profiles);
  if (manifest.security) common["security"] = folder + "/security";
}

YAML::Node settings_on(const Manifest& manifest, const TrainHost& host, const std::string& folder) {
  YAML::Node settings = YAML::Clone(manifest.settings);
  fill_common(settings, manifest, host, folder);
  point_to_host(settings, setting_files(manifest), folder);
  for (const char* service : {"map_matcher", "fusion", "tpr_publisher", "recorder", "monitor"}) {
    if (manifest.service(service) != nullptr) fill(settings[service], "map", in_folder(folder, manifest.map));
  }
  if (manifest.service("frame_grabber") != nullptr)
    fill(settings["frame_grabber"], "calibration", in_folder(folder, manifest.calibration));
  if (manifest.service("recorder") != nullptr) {
    fill(settings["recorder"], "train_file", folder + "/config.yaml");
    fill(settings["recorder"], "folder", kUsualRecordings);
  }
  // The page is for the train network, not for every other one that this computer is in.
  if (manifest.service("monitor") != nullptr) fill(settings["monitor"], "address", host.address);
  if (manifest.service("monitor") != nullptr && !settings["monitor"]["expected"]) {
    for (const auto& service : manifest.services) {
      if (service.name == "monitor") continue;
      for (const auto& on : {service.host, service.standby}) {
        if (!on.empty()) settings["monitor"]["expected"].push_back(service.name + "@" + on);
      }
    }
  }
  return settings;
}

bool is_secret(const fs::path& file) {
  const auto place = file.parent_path().filename();
  if (place == "files") return is_file_on_host(file);
  return place == "security" && (file.extension() == ".pem" || file.extension() == ".p7s");
}

// Of what was rendered into this folder before. Files of others stay.
bool remove_secrets(const fs::path& folder) {
  bool removed = false;
  std::error_code none;
  for (const char* name : {"security", "files"}) {
    std::vector<fs::path> secrets;
    for (const auto& entry : fs::directory_iterator(folder / name, none)) {
      if (is_secret(entry.path())) secrets.push_back(entry.path());
    }
    for (const auto& secret : secrets) removed = fs::remove(secret, none) || removed;
  }
  return removed;
}

// The keys of this host: the owner and the services' group may read them.
core::Status copy_files(const Manifest& manifest, const TrainHost& host, const fs::path& folder) {
  const auto options = fs::copy_options::overwrite_existing | fs::copy_options::recursive;
  std::vector<std::pair<fs::path, fs::path>> files;
  for (const auto& name : {manifest.map, manifest.calibration, manifest.qos_profiles}) {
    if (!name.empty()) files.emplace_back(manifest.folder / name, folder / fs::path(name).filename());
  }
  if (manifest.security) files.emplace_back(manifest.folder / "security" / host.name, folder / "security");
  for (const auto& file : setting_files(manifest))
    files.emplace_back(manifest.folder / file.file, file.on_host(folder.string()));
  for (const auto& [from, to] : files) {
    std::error_code failed;
    fs::create_directories(to.parent_path(), failed);
    fs::copy(from, to, options, failed);
    if (failed) return core::Error{from.string() + " cannot be copied to " + to.string() + ": " + failed.message()};
  }
  return {};
}

// A line for each key: "tpr_publisher.nid_engine: 460042".
std::string lines_of(const YAML::Node& node, const std::string& key) {
  if (!node.IsMap()) {
    YAML::Emitter value;
    value << YAML::Flow << node;
    return key + ": " + value.c_str() + "\n";
  }
  std::string text;
  for (const auto& entry : node) text += lines_of(entry.second, key + "." + entry.first.Scalar());
  return text;
}

// Changes with every byte of the file, or of the files in the folder.
std::string fingerprint(const fs::path& path) {
  core::Fnv hash;
  std::vector<fs::path> files;
  if (fs::is_directory(path)) {
    for (const auto& entry : fs::directory_iterator(path)) files.push_back(entry.path());
    std::sort(files.begin(), files.end());
  } else {
    files.push_back(path);
  }
  for (const auto& file : files) {
    if (const auto text = core::read_whole(file); text.ok()) hash.add(text.value());
  }
  return std::to_string(hash.value());
}

}  // namespace

std::vector<fs::path> remove_secrets_of_others(const Manifest& manifest, const fs::path& out) {
  std::vector<fs::path> others;
  std::error_code none;
  for (const auto& entry : fs::directory_iterator(out, none)) {
    if (manifest.host(entry.path().filename().string()) != nullptr) continue;
    std::string first;
    std::getline(std::ifstream(entry.path() / "config.yaml"), first);
    if (first == std::string("# ") + kMade && remove_secrets(entry.path())) others.push_back(entry.path());
  }
  return others;
}

std::vector<std::string> service_arguments(const HostedService& service) {
  if (service.strength == 0) return {};
  return {"--set", "common.ownership_strength=" + std::to_string(service.strength)};
}

std::vector<HostedService> services_on(const Manifest& manifest, const std::string& host) {
  std::vector<HostedService> here;
  for (const auto& service : manifest.services) {
    const auto release = manifest.release_of(service);
    if (service.host == host)
      here.push_back({service.name, release, false, service.standby.empty() ? 0 : kPrimaryStrength});
    if (service.standby == host) here.push_back({service.name, release, true, kStandbyStrength});
  }
  return here;
}

std::string render_config(const Manifest& manifest, const TrainHost& host, const std::string& folder) {
  YAML::Emitter out;
  out << settings_on(manifest, host, folder);
  return std::string("# ") + kMade + "\n" + out.c_str() + "\n";
}

std::string settings_of(const Manifest& manifest, const TrainHost& host, const std::string& service) {
  const auto settings = settings_on(manifest, host, "FOLDER");
  std::string text = lines_of(settings["common"], "common");
  if (settings[service]) text += lines_of(settings[service], service);
  for (const auto& one : services_on(manifest, host.name)) {
    if (one.name == service && one.strength != 0)
      text += "common.ownership_strength: " + std::to_string(one.strength) + "\n";
  }
  const auto mentions = [&](const std::string& file) {
    return !file.empty() && text.find(in_folder("FOLDER", file)) != std::string::npos;
  };
  for (const auto& file : {manifest.map, manifest.calibration, manifest.qos_profiles}) {
    if (mentions(file)) text += file + ": fingerprint " + fingerprint(manifest.folder / file) + "\n";
  }
  for (const auto& file : setting_files(manifest)) {
    if (file.service == service)
      text += service + "." + file.key + ": fingerprint " + fingerprint(manifest.folder / file.file) + "\n";
  }
  if (manifest.containers) {
    // Another build of the same release is another image.
    const auto engine = container_engine(manifest);
    const HostedService one{service, manifest.release_of(*manifest.service(service))};
    text +=
        "image: " + (engine.ok() ? image_id(engine.value(), image_of(one)) : std::nullopt).value_or("missing") + "\n";
  }
  if (manifest.security) {
    for (const auto& file : {service + ".cert.pem", service + ".permissions.p7s", std::string("ca.pem")})
      text += file + ": fingerprint " + fingerprint(manifest.folder / "security" / host.name / file) + "\n";
  }
  return text;
}

std::optional<fs::path> program_of(const HostedService& service, const fs::path& root) {
  const std::string name = "railfix-" + dashed(service.name);
  auto program = fs::absolute(root) / "opt/railfix" / service.release / "bin" / name;
  if (!fs::exists(program) && service.release == RAILFIX_VERSION)
    program = fs::read_symlink("/proc/self/exe").parent_path() / name;
  return fs::exists(program) ? std::optional(program.lexically_normal()) : std::nullopt;
}

core::Result<std::vector<std::string>> program_command(const HostedService& service, const fs::path& folder,
                                                       const fs::path& root) {
  const auto at = fs::absolute(folder).lexically_normal().string();
  const auto program = program_of(service, root);
  if (!program) {
    const auto missing = root / "opt/railfix" / service.release / "bin";
    return core::Error{"release " + service.release + " of " + service.name + " is not installed on this computer: " +
                       (missing / ("railfix-" + dashed(service.name))).string() + " is missing (package railfix-" +
                       service.release + ")"};
  }
  std::vector<std::string> command{program->string(), "--config", at + "/config.yaml"};
  const auto arguments = service_arguments(service);
  command.insert(command.end(), arguments.begin(), arguments.end());
  return command;
}

std::string render_compose(const Manifest& manifest, const TrainHost& host, const std::string& folder) {
  YAML::Emitter out;
  out << YAML::Comment(kMade) << YAML::BeginMap;
  out << YAML::Key << "version" << YAML::Value << YAML::DoubleQuoted << "3.7";
  out << YAML::Key << "services" << YAML::Value << YAML::BeginMap;
  for (const auto& service : services_on(manifest, host.name)) {
    const auto container = container_of(manifest, host, service, folder, kContainerHome);
    out << YAML::Key << dashed(service.name) << YAML::Value << compose_service(container);
  }
  out << YAML::EndMap << YAML::EndMap;
  return std::string(out.c_str()) + "\n";
}

core::Status render_host(const Manifest& manifest, const TrainHost& host, const fs::path& folder) {
  const auto at = fs::absolute(folder).lexically_normal().string();
  std::error_code failed;
  fs::create_directories(folder, failed);
  if (failed) return core::Error{folder.string() + " cannot be made: " + failed.message()};
  remove_secrets(folder);  // another train's, or of a service that has gone
  if (const auto copied = copy_files(manifest, host, folder); !copied.ok()) return copied;
  for (const auto& [name, text] :
       std::map<std::string, std::string>{{"config.yaml", render_config(manifest, host, at)},
                                          {"compose.yaml", render_compose(manifest, host, at)},
                                          {"systemd/railfix.service", kSystemdUnit},
                                          {"systemd/60-railfix.conf", kSysctl}}) {
    if (const auto written = core::write_whole_with_folders(folder / name, text); !written.ok()) return written;
  }
  if (!manifest.containers || geteuid() != 0) return {};
  for (const char* secrets : {"security", "files"}) {
    if (!fs::exists(folder / secrets)) continue;
    if (const auto handed = hand_over(folder / secrets); !handed.ok()) return handed;
  }
  return {};
}

}  // namespace railfix::tool
