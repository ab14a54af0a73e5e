// Settings that name files which lie beside train.yaml: certificates and passwords of the ground link and of the page.
#pragma once

#include <string>
#include <vector>

#include "train/manifest.hpp"

namespace railfix::tool {

struct SettingFile {
  std::string service;
  std::string key;             // "ground_link.ca_file"
  std::filesystem::path file;  // as train.yaml has it, beside train.yaml
  bool is_certificate = false;
  /// Where it lies in the folder of a host.
  [[nodiscard]] std::string on_host(const std::string& folder) const {
    return folder + "/files/" + service + "." + key + file.extension().string();
  }
};

/// Named as one of them is on a host.
bool is_file_on_host(const std::filesystem::path& file);

/// The settings of a generation; empty when they cannot be read, which others say.
YAML::Node installed_settings(const std::filesystem::path& generation);
/// The text of "key" or "group.key" in a service's section; empty when it is not given.
std::string setting_of(const YAML::Node& settings, const std::string& service, const std::string& key);

/// Those that the manifest gives. An absolute path is a file that the host has already, and not among them.
std::vector<SettingFile> setting_files(const Manifest& manifest);
/// Certificates that the settings name, those that the host has already among them.
std::vector<SettingFile> certificate_files(const YAML::Node& settings);
/// Private keys that the settings name, each with the file of the certificate that it has to belong to.
struct KeyFile {
  SettingFile key;
  std::filesystem::path certificate;
};
std::vector<KeyFile> key_files(const YAML::Node& settings);
/// Makes the settings name the files in the folder of a host.
void point_to_host(YAML::Node settings, const std::vector<SettingFile>& files, const std::string& folder);

}  // namespace railfix::tool
