// How much room the services of a host may take on its disks, by their settings.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "train/manifest.hpp"
#include "train/plan.hpp"

namespace railfix::tool {

struct DiskNeed {
  std::filesystem::path folder;  // may not be there yet
  double mb = 0;                 // free, beside what lies there already
  std::string what;              // "150 MB of recordings (recorder.quota_mb)"
};

/// Where a service's path lies on the computer whose folder of services is `home`: containers see that folder under its
/// usual name.
std::filesystem::path place_on_host(const std::filesystem::path& path, const std::filesystem::path& home,
                                    bool containers);

/// Of what `host` will run with its files below `root`.
std::vector<DiskNeed> disk_needs(const Manifest& manifest, const TrainHost& host, const std::filesystem::path& root);
/// Of what was brought up on this computer; with nothing brought up, of a host that does everything as settings begin.
std::vector<DiskNeed> installed_disk_needs(const HostFolder& folder);

/// What settings that are not given begin with; the recorder's and tpr_publisher's own words.
inline constexpr double kUsualKeepFreeMb = 500;
inline constexpr double kUsualStoreLimit = 100'000;
/// More than a report takes in the store.
inline constexpr double kStoredReportBytes = 256;

}  // namespace railfix::tool
