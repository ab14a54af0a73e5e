#include "train/disk_need.hpp"

#include <algorithm>
#include <cmath>
#include <set>

#include "train/containers.hpp"
#include "train/render.hpp"
#include "train/setting_files.hpp"

namespace railfix::tool {
namespace {

namespace fs = std::filesystem;

constexpr double kLogsMb = 200;         // with the files of five generations
constexpr double kRecordingsMb = 2000;  // without a quota they take what there is; with less it is not worth beginning
constexpr double kBytesPerMb = 1e6;

struct Host {
  YAML::Node settings;
  std::set<std::string> services;
  bool containers = false;
  fs::path home;

  [[nodiscard]] double number(const char* service, const char* key, double usual) const {
    double value = usual;
    const auto text = setting_of(settings, service, key);
    if (!text.empty()) (void)YAML::convert<double>::decode(YAML::Node(text), value);
    return value;
  }
  [[nodiscard]] fs::path place(const fs::path& path) const { return place_on_host(path, home, containers); }
};

std::string megabytes(double mb) {
  return std::to_string(static_cast<int64_t>(std::ceil(mb))) + " MB ";
}

double megabytes_in(const fs::path& folder, const std::string& in_name) {
  double bytes = 0;
  std::error_code gone;
  for (const auto& entry : fs::directory_iterator(folder, gone)) {
    std::error_code removed;
    const auto size = entry.file_size(removed);
    if (!removed && entry.path().filename().string().find(in_name) != std::string::npos)
      bytes += static_cast<double>(size);
  }
  return bytes / kBytesPerMb;
}

// What is recorded already needs no more room. The recorder stops where only keep_free_mb are left.
void add_recordings(const Host& host, std::vector<DiskNeed>& needs) {
  const auto given = setting_of(host.settings, "recorder", "folder");
  const auto folder = host.place(given.empty() ? std::string(kUsualRecordings) : given);
  const double quota_mb = host.number("recorder", "quota_mb", 0);
  const double missing_mb = (quota_mb > 0 ? quota_mb : kRecordingsMb) - megabytes_in(folder, ".mcap");
  if (missing_mb <= 0) return;
  const double keep_free_mb = host.number("recorder", "keep_free_mb", kUsualKeepFreeMb);
  needs.push_back(
      {folder, missing_mb,
       megabytes(missing_mb) + (quota_mb > 0 ? "of recordings up to recorder.quota_mb"
                                             : "to begin recording with, because recorder.quota_mb is not set")});
  needs.push_back({folder, keep_free_mb, megabytes(keep_free_mb) + "that it leaves free (recorder.keep_free_mb)"});
}

void add_store(const Host& host, std::vector<DiskNeed>& needs) {
  const fs::path file = setting_of(host.settings, "tpr_publisher", "ground_link.store");
  if (setting_of(host.settings, "tpr_publisher", "ground_link.broker").empty() || file.empty()) return;
  const double limit = host.number("tpr_publisher", "ground_link.store_limit", kUsualStoreLimit);
  const auto there = host.place(file);
  const double there_mb = megabytes_in(there.parent_path(), there.filename());
  const double missing_mb = limit * kStoredReportBytes / kBytesPerMb - there_mb;
  if (missing_mb <= 0) return;
  needs.push_back(
      {there.parent_path(), missing_mb,
       megabytes(missing_mb) + "of reports that wait for the ground (tpr_publisher.ground_link.store_limit)"});
}

std::vector<DiskNeed> needs_of(const Host& host) {
  std::vector<DiskNeed> needs{{host.home, kLogsMb, megabytes(kLogsMb) + "of logs and configurations"}};
  if (host.services.contains("recorder")) add_recordings(host, needs);
  if (host.services.contains("tpr_publisher")) add_store(host, needs);
  return needs;
}

}  // namespace

fs::path place_on_host(const fs::path& path, const fs::path& home, bool containers) {
  const auto inside = path.lexically_relative(kContainerHome);
  return home / (containers && !inside.empty() && *inside.begin() != ".." ? inside : path);
}

std::vector<DiskNeed> disk_needs(const Manifest& manifest, const TrainHost& host, const fs::path& root) {
  Host all{manifest.settings, {}, manifest.containers, HostFolder(root).home()};
  for (const auto& service : services_on(manifest, host.name)) all.services.insert(service.name);
  return needs_of(all);
}

std::vector<DiskNeed> installed_disk_needs(const HostFolder& folder) {
  Host all{YAML::Node(YAML::NodeType::Map), {"recorder"}, false, folder.home()};
  if (const auto plan = folder.plan()) {
    all.settings = installed_settings(folder.generation(plan->generation));
    all.services.clear();
    for (const auto& service : plan->services) {
      all.services.insert(service.name);
      all.containers = all.containers || service.in_container();
    }
  }
  return needs_of(all);
}

}  // namespace railfix::tool
