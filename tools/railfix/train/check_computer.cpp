// This computer as a host of a train.
#include <sys/stat.h>
#include <sys/statvfs.h>

#include <algorithm>
#include <cmath>
#include <ctime>
#include <fstream>
#include <map>

#include "core/kernel_clock.hpp"
#include "core/time.hpp"
#include "messaging/network.hpp"
#include "train/disk_need.hpp"
#include "train/findings.hpp"
#include "train/setting_files.hpp"

namespace railfix::tool {
namespace {

namespace fs = std::filesystem;

constexpr double kPicturesMb = 512;  // histories of two cameras
constexpr double kSharedMemoryMb = 16;
constexpr int64_t kClocksMayDifferS = 3600;  // of who wrote train.yaml elsewhere

std::string rounded(double mb) {
  return std::to_string(static_cast<int64_t>(mb));
}

double megabytes_free(const fs::path& folder) {
  struct statvfs disk {};
  if (statvfs(folder.c_str(), &disk) != 0) return -1;
  return static_cast<double>(disk.f_bavail) * static_cast<double>(disk.f_frsize) / 1e6;
}

void check_shared_memory(bool pictures, Findings& findings) {
  const double needed_mb = pictures ? kPicturesMb : kSharedMemoryMb;
  const double free_mb = megabytes_free("/dev/shm");
  if (free_mb < 0) return error(findings, "/dev/shm is not there; mount a tmpfs on it");
  if (free_mb < needed_mb)
    error(findings, "/dev/shm has " + std::to_string(static_cast<int>(free_mb)) + " MB free, this host needs " +
                        std::to_string(static_cast<int>(needed_mb)) +
                        "; mount -o remount,size=2G /dev/shm, and remove " +
                        "fast_datasharing_* there when no service runs");
}

std::string utc(int64_t time_s) {
  const time_t time = time_s;
  tm parts{};
  char text[32];
  std::strftime(text, sizeof text, "%Y-%m-%d %H:%M UTC", gmtime_r(&time, &parts));
  return text;
}

void check_clock_keeper(bool several_hosts, Findings& findings) {
  if (core::clock_error_ns()) return;
  warning(findings, std::string("nobody keeps this computer's clock (chronyd, or ptp4l with phc2sys): reports and "
                                "recordings may carry wrong times") +
                        (several_hosts ? ", and stamps of two hosts cannot be compared" : ""));
}

// What cannot be of the future: this program, the manifest, what was brought up here last.
std::vector<fs::path> dated_files(const Manifest* manifest, const HostFolder& folder) {
  std::vector<fs::path> files{"/proc/self/exe"};
  if (manifest != nullptr) files.push_back(manifest->folder / "train.yaml");
  if (const int newest = folder.newest_generation(); newest > 0)
    files.push_back(folder.generation(newest) / "plan.yaml");
  return files;
}

// The folder, or the one above it that is there: where its disk will be.
fs::path standing(fs::path folder) {
  while (!fs::exists(folder) && folder.has_relative_path()) folder = folder.parent_path();
  return folder;
}

dev_t disk_of(const fs::path& folder) {
  struct stat found {};
  return stat(folder.c_str(), &found) == 0 ? found.st_dev : 0;
}

// What lies on one disk needs room there together.
void check_disks(const std::vector<DiskNeed>& needs, Findings& findings) {
  struct Disk {
    fs::path folder;
    double needed_mb = 0;
    std::string what_for;
  };
  std::map<dev_t, Disk> disks;
  for (const auto& need : needs) {
    const auto there = standing(need.folder);
    auto& disk = disks[disk_of(there)];
    if (disk.folder.empty()) disk.folder = there;
    disk.needed_mb += need.mb;
    disk.what_for += (disk.what_for.empty() ? "" : ", ") + need.what;
  }
  for (const auto& [device, disk] : disks) {
    const double free_mb = std::max(megabytes_free(disk.folder), 0.0);
    if (free_mb >= disk.needed_mb) continue;
    error(findings, disk.folder.string() + " has " + rounded(free_mb) + " MB free, this host needs " +
                        rounded(std::ceil(disk.needed_mb)) + " MB there (" + disk.what_for +
                        "); make room, or set what is named to less");
  }
}

// Cameras and receivers come and go, and their services wait for them; recorded data are there or not.
void check_sources(const Manifest& manifest, const TrainHost& host, const fs::path& root, Findings& findings) {
  for (const char* player : {"frame_grabber", "sensor_gateway"}) {
    const auto* service = manifest.service(player);
    const std::string source = setting_of(manifest.settings, player, "source");
    if (service == nullptr || service->host != host.name || !source.starts_with('/')) continue;
    const auto place = place_on_host(source, HostFolder(fs::absolute(root)).home(), manifest.containers);
    if (!fs::exists(place))
      error(findings, std::string("settings.") + player + ".source: " + place.string() +
                          " is not on this computer, and " + player + " would have nothing to play; copy it there");
  }
}

void check_interface(const TrainHost& host, Findings& findings) {
  const std::string interface = host.interface.empty() ? host.address : host.interface;
  if (const auto found = messaging::addresses_of({interface}); !found.ok()) {
    error(findings, "host " + host.name + ": " + found.error().message);
  } else if (messaging::running_interfaces({interface}) == 0) {
    warning(findings, "host " + host.name + ": interface " + interface + " has no carrier; is the cable in?");
  }
}

// As container_problems() of their images.
void check_programs(const Manifest& manifest, const TrainHost& host, const fs::path& root, Findings& findings) {
  for (const auto& service : services_on(manifest, host.name)) {
    if (const auto command = program_command(service, root, root); !command.ok())
      error(findings, command.error().message);
  }
}

}  // namespace

std::vector<Finding> check_kernel(const fs::path& proc_sys) {
  // What 60-railfix.conf sets, and what is still enough. Fragments of a datagram that has lost one fill the memory for
  // them until their time is over: with 30 s a link that drops is blocked.
  struct Setting {
    const char* name;
    int64_t set;
    int64_t enough;
    bool at_least;
    const char* otherwise;
  };
  static constexpr Setting kSettings[] = {
      {"net.core.rmem_max", 16777216, 4 << 20, true, "too small for bursts between hosts"},
      {"net.core.wmem_max", 16777216, 4 << 20, true, "too small for bursts between hosts"},
      {"net.ipv4.ipfrag_time", 3, 5, false, "so long that lost fragments block the link between hosts"},
      {"net.ipv4.ipfrag_high_thresh", 134217728, 16 << 20, true, "too small for fragments of bursts between hosts"}};
  Findings findings;
  for (const auto& setting : kSettings) {
    const std::string name = setting.name;
    std::string path = name;
    std::replace(path.begin(), path.end(), '.', '/');
    int64_t value = 0;
    std::ifstream file(proc_sys / path);
    if (!(file >> value) || (setting.at_least ? value >= setting.enough : value <= setting.enough)) continue;
    warning(findings, name + " is " + std::to_string(value) + ", " + setting.otherwise + "; sysctl -w " + name + "=" +
                          std::to_string(setting.set) + " (60-railfix.conf of railfix train render does it)");
  }
  return findings;
}

std::vector<Finding> check_clock_date(const std::vector<fs::path>& files, int64_t now_s) {
  fs::path newest;
  int64_t made_s = now_s + kClocksMayDifferS;
  for (const auto& file : files) {
    struct stat found {};
    if (stat(file.c_str(), &found) != 0 || found.st_mtime <= made_s) continue;
    made_s = found.st_mtime;
    std::error_code none;
    newest = fs::is_symlink(file, none) ? fs::read_symlink(file, none) : file;
  }
  if (newest.empty()) return {};
  return {{true, "this computer's clock is wrong: it says " + utc(now_s) + ", but " + newest.string() + " is of " +
                     utc(made_s) + "; set it (chronyc makestep, or date --set), otherwise reports and recordings " +
                     "carry wrong times. If the clock is right: touch " + newest.string()}};
}

std::vector<Finding> check_computer(const Manifest* manifest, const TrainHost* host, const fs::path& root) {
  Findings findings;
  const auto add = [&](std::vector<Finding> more) { findings.insert(findings.end(), more.begin(), more.end()); };
  const auto runs = [&](const char* service) {
    if (manifest == nullptr || host == nullptr) return true;
    const auto* one = manifest->service(service);
    return one != nullptr && one->host == host->name;
  };
  check_shared_memory(runs("frame_grabber"), findings);
  const bool several_hosts = manifest == nullptr || manifest->hosts.size() > 1;
  if (several_hosts) add(check_kernel());
  add(check_clock_date(dated_files(manifest, HostFolder(fs::absolute(root))), core::wall_ns() / core::kNsPerSecond));
  check_clock_keeper(several_hosts, findings);
  check_disks(manifest == nullptr || host == nullptr ? installed_disk_needs(HostFolder(fs::absolute(root)))
                                                     : disk_needs(*manifest, *host, fs::absolute(root)),
              findings);
  if (host != nullptr) check_interface(*host, findings);
  if (manifest == nullptr || host == nullptr) return findings;
  check_sources(*manifest, *host, root, findings);
  add(check_page(*manifest, *host, fs::absolute(root)));
  if (!manifest->containers) check_programs(*manifest, *host, root, findings);
  if (manifest->containers) {
    for (const auto& problem : container_problems(*manifest, *host)) error(findings, problem);
  }
  return findings;
}

}  // namespace railfix::tool
