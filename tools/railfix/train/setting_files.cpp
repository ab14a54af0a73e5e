#include "train/setting_files.hpp"

#include <algorithm>

#include "service/yaml_file.hpp"

namespace railfix::tool {
namespace {

struct Place {
  const char* service;
  const char* group;  // empty = the section itself
  const char* key;
  bool is_certificate = false;
  const char* key_of_certificate = "";  // it is the private key of the certificate that this key names
};
constexpr Place kPlaces[] = {{"tpr_publisher", "ground_link", "ca_file", true},
                             {"tpr_publisher", "ground_link", "certificate_file", true},
                             {"tpr_publisher", "ground_link", "key_file", false, "certificate_file"},
                             {"tpr_publisher", "ground_link", "password_file"},
                             {"monitor", "", "token_file"},
                             {"monitor", "", "tls_certificate", true},
                             {"monitor", "", "tls_key", false, "tls_certificate"}};

std::string key_of(const Place& place) {
  return (*place.group == '\0' ? "" : std::string(place.group) + ".") + place.key;
}

// The section that holds the key, undefined when there is none.
YAML::Node section_of(const YAML::Node& settings, const Place& place) {
  if (!settings || !settings.IsMap()) return YAML::Node(YAML::NodeType::Undefined);
  const YAML::Node section = settings[place.service];
  if (*place.group == '\0' || !section || !section.IsMap()) return section;
  return section[place.group];
}

// Empty when it is not given.
std::filesystem::path file_in(const YAML::Node& section, const std::string& key) {
  const bool given = section && section.IsMap() && section[key] && section[key].IsScalar();
  return given ? section[key].Scalar() : std::string();
}

std::vector<SettingFile> files_named(const YAML::Node& settings) {
  std::vector<SettingFile> files;
  for (const auto& place : kPlaces) {
    const auto file = file_in(section_of(settings, place), place.key);
    if (!file.empty()) files.push_back({place.service, key_of(place), file, place.is_certificate});
  }
  return files;
}

}  // namespace

bool is_file_on_host(const std::filesystem::path& file) {
  const auto name = file.filename().string();
  return std::ranges::any_of(kPlaces, [&](const Place& place) {
    const auto usual = std::string(place.service) + "." + key_of(place);
    return name == usual || name.starts_with(usual + ".");
  });
}

YAML::Node installed_settings(const std::filesystem::path& generation) {
  try {
    return service::load_yaml(generation / "config.yaml");
  } catch (const YAML::Exception&) {
    return {};
  }
}

std::string setting_of(const YAML::Node& settings, const std::string& service, const std::string& key) {
  if (!settings || !settings.IsMap()) return "";
  const YAML::Node section = settings[service];
  const auto dot = key.find('.');
  const bool grouped = dot != std::string::npos && section && section.IsMap();
  const YAML::Node group = grouped ? section[key.substr(0, dot)] : section;
  if (!group || !group.IsMap()) return "";
  const YAML::Node value = group[key.substr(dot == std::string::npos ? 0 : dot + 1)];
  return value && value.IsScalar() ? value.Scalar() : "";
}

std::vector<SettingFile> setting_files(const Manifest& manifest) {
  auto files = files_named(manifest.settings);
  std::erase_if(files, [](const auto& file) { return file.file.is_absolute(); });
  return files;
}

std::vector<SettingFile> certificate_files(const YAML::Node& settings) {
  auto files = files_named(settings);
  std::erase_if(files, [](const auto& file) { return !file.is_certificate; });
  return files;
}

std::vector<KeyFile> key_files(const YAML::Node& settings) {
  std::vector<KeyFile> keys;
  for (const auto& place : kPlaces) {
    const auto section = section_of(settings, place);
    const auto file = file_in(section, place.key);
    const auto certificate = file_in(section, place.key_of_certificate);
    if (!file.empty() && !certificate.empty()) keys.push_back({{place.service, key_of(place), file}, certificate});
  }
  return keys;
}

void point_to_host(YAML::Node settings, const std::vector<SettingFile>& files, const std::string& folder) {
  for (const auto& file : files) {
    for (const auto& place : kPlaces) {
      if (file.service == place.service && file.key == key_of(place))
        section_of(settings, place)[place.key] = file.on_host(folder);
    }
  }
}

}  // namespace railfix::tool
