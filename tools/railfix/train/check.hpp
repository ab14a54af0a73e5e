// Everything that can be known to go wrong before a train starts.
#pragma once

#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "train/manifest.hpp"
#include "train/plan.hpp"
#include "train/render.hpp"

namespace railfix::tool {

struct Finding {
  bool error = true;  // false: a warning; the train may start
  std::string text;   // what is wrong, where, what to do
  bool operator==(const Finding&) const = default;
};

struct TrainCheck {
  std::vector<Finding> findings;
  std::map<std::string, TopicLayouts> made_of;  // of each service whose program or image is here
};

/// The manifest against itself and the files beside it: placement of services, ports, files, certificates, and every
/// service's own check of its configuration, with its image or the program that is found for it; skipped and said when
/// this computer has none. So is it known whether all of them were made of the same topics.
using FindProgram = std::function<std::optional<std::filesystem::path>(const HostedService&)>;
TrainCheck check_train(const Manifest& manifest, const FindProgram& find_program);

/// Certificates of one host beside the manifest, and those that its services' settings name: missing, run out, or about
/// to (settings.monitor.certificate_days).
std::vector<Finding> check_certificates(const Manifest& manifest, const TrainHost& host);
/// Those that the services of this computer run with.
std::vector<Finding> check_installed_certificates(const HostFolder& folder);

/// This computer as a host: shared memory, kernel, clock, disks, interface. With a manifest, for what `host` runs, with
/// its files and programs below `root`.
std::vector<Finding> check_computer(const Manifest* manifest, const TrainHost* host, const std::filesystem::path& root);
/// Address and port where the monitor is to serve its page on this computer. The port may be that of the one that runs.
std::vector<Finding> check_page(const Manifest& manifest, const TrainHost& host, const std::filesystem::path& root);
/// A clock that says less than the time when one of these files was made is wrong, whoever keeps it: the one that a
/// computer begins with when its battery is empty, with nobody to set it.
std::vector<Finding> check_clock_date(const std::vector<std::filesystem::path>& files, int64_t now_s);
/// The kernel's settings for traffic between hosts.
std::vector<Finding> check_kernel(const std::filesystem::path& proc_sys = "/proc/sys");

}  // namespace railfix::tool
