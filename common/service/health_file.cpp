#include "service/health_file.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <fstream>

#include "core/time.hpp"
#include "messaging/operation_words.hpp"

namespace railfix::service {
namespace {

constexpr int64_t kSilentNs = 2 * core::kNsPerSecond;
constexpr size_t kBytes = 512;

int opened(const std::filesystem::path& path) {
  return open(path.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC, 0644);
}

bool removed(int file) {
  struct stat now {};
  return fstat(file, &now) == 0 && now.st_nlink == 0;
}

}  // namespace

std::filesystem::path health_path(const CommonConfig& common, const std::string& service) {
  return "/dev/shm/railfix-health-" + common.train_id + "-" + common.host + "-" + service;
}

std::filesystem::path health_path_beside(const CommonConfig& common, const std::string& service) {
  return health_path(common, service).string() + "-beside";
}

HealthFile::HealthFile(std::filesystem::path path) : path_(std::move(path)), file_(opened(path_)) {}

// Another build of this service may have taken over the file; it makes a new one with its next words.
HealthFile::~HealthFile() {
  if (file_ < 0) return;
  close(file_);
  unlink(path_.c_str());
}

void HealthFile::write(const msg::ServiceStatus& status) {
  words_ = std::to_string(status.state()) + '\n' + status.reason().c_str();
  beat();
}

void HealthFile::beat() {
  if (words_.empty()) return;
  if (file_ >= 0 && removed(file_)) {
    close(file_);
    file_ = opened(path_);
  }
  std::string text = std::to_string(core::monotonic_ns()) + ' ' + words_;
  text.resize(kBytes, '\n');
  if (file_ >= 0 && pwrite(file_, text.data(), text.size(), 0) < 0) unlink(path_.c_str());
}

std::optional<int64_t> silent_ns(const std::filesystem::path& path) {
  std::ifstream in(path);
  int64_t said_ns = 0;
  if (!(in >> said_ns)) return std::nullopt;
  return core::monotonic_ns() - said_ns;
}

HealthAnswer ask_health(const std::filesystem::path& path) {
  std::ifstream in(path);
  int64_t said_ns = 0;
  int state = -1;
  std::string reason;
  if (!(in >> said_ns >> state))
    return {.healthy = false, .text = "does not run here: " + path.string() + " is missing"};
  std::getline(in >> std::ws, reason);
  const int64_t age_ns = core::monotonic_ns() - said_ns;
  if (age_ns > kSilentNs || age_ns < 0) {  // negative: from before the computer was started
    return {.healthy = false,
            .text = "dead or frozen: silent for " + std::to_string(std::abs(age_ns) / core::kNsPerSecond) + " s"};
  }
  const std::string text =
      std::string(messaging::name_of_state(static_cast<uint8_t>(state))) + (reason.empty() ? "" : ": " + reason);
  return {.healthy = state != msg::STATE_FAILED && state != msg::STATE_STOPPED,
          .starting = state == msg::STATE_STARTING,
          .degraded = state == msg::STATE_DEGRADED,
          .text = text};
}

}  // namespace railfix::service
