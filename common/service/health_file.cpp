#include "service/health_file.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cstdio>
#include <fstream>
#include <sstream>

#include "core/time.hpp"
#include "messaging/message_words.hpp"

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

/// Another build of the service may have its file there by now.
bool is_at(int file, const std::filesystem::path& path) {
  struct stat ours {};
  struct stat there {};
  return fstat(file, &ours) == 0 && stat(path.c_str(), &there) == 0 && ours.st_dev == there.st_dev &&
         ours.st_ino == there.st_ino;
}

std::string ago(const char* what, int64_t at_ns, int64_t now_ns) {
  if (at_ns == 0) return std::string("no ") + what + " yet";
  char text[48];
  std::snprintf(text, sizeof text, "last %s %.1f s ago", what, core::seconds(now_ns - at_ns));
  return text;
}

// Nothing by a build that does not say it.
void judge_traffic(std::istream& in, int64_t now_ns, HealthAnswer& answer) {
  Traffic traffic;
  int flow = 0;
  if (!(in >> flow >> traffic.stands_by >> traffic.input_since_ns >> traffic.last_input_ns >> traffic.last_output_ns))
    return;
  traffic.flow = static_cast<Flow>(flow);
  const auto lately = [&](int64_t at_ns) { return at_ns != 0 && now_ns - at_ns < kFlowGapNs; };
  const bool input_flows = lately(traffic.last_input_ns) && !lately(traffic.input_since_ns);
  answer.stands_by = traffic.stands_by;
  if (traffic.last_input_ns != 0) answer.input_s = core::seconds(now_ns - traffic.last_input_ns);
  answer.sends = traffic.flow != Flow::sporadic && lately(traffic.last_output_ns);
  answer.stuck = traffic.flow == Flow::answers && !traffic.stands_by && input_flows && !lately(traffic.last_output_ns);
  if (answer.stuck) answer.text = "input comes, nothing goes out: " + answer.text;
  answer.text +=
      " (" + ago("input", traffic.last_input_ns, now_ns) + ", " + ago("output", traffic.last_output_ns, now_ns) + ")";
}

}  // namespace

std::filesystem::path health_path(const CommonConfig& common, const std::string& service) {
  return "/dev/shm/railfix-health-" + common.train_id + "-" + common.host + "-" + service;
}

std::filesystem::path health_path_beside(const CommonConfig& common, const std::string& service) {
  return health_path(common, service).string() + "-beside";
}

HealthFile::HealthFile(std::filesystem::path path) : path_(std::move(path)), file_(opened(path_)) {}

HealthFile::~HealthFile() {
  if (file_ < 0) return;
  if (is_at(file_, path_)) unlink(path_.c_str());
  close(file_);
}

void HealthFile::write(const msg::ServiceStatus& status, const Traffic& traffic, const std::string& serves) {
  std::ostringstream words;
  words << static_cast<int>(status.state()) << '\n'
        << status.reason().c_str() << '\n'
        << static_cast<int>(traffic.flow) << ' ' << traffic.stands_by << ' ' << traffic.input_since_ns << ' '
        << traffic.last_input_ns << ' ' << traffic.last_output_ns << '\n'
        << serves;
  words_ = words.str();
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
  in.ignore();  // the end of the line before: a reason may be empty
  std::getline(in, reason);
  const int64_t age_ns = core::monotonic_ns() - said_ns;
  if (age_ns > kSilentNs || age_ns < 0) {  // negative: from before the computer was started
    return {.healthy = false,
            .text = "dead or frozen: silent for " + std::to_string(std::abs(age_ns) / core::kNsPerSecond) + " s"};
  }
  const std::string text =
      std::string(messaging::name_of_state(static_cast<uint8_t>(state))) + (reason.empty() ? "" : ": " + reason);
  HealthAnswer answer{.healthy = state != msg::STATE_FAILED && state != msg::STATE_STOPPED,
                      .starting = state == msg::STATE_STARTING,
                      .degraded = state == msg::STATE_DEGRADED,
                      .text = text};
  judge_traffic(in, said_ns, answer);
  in >> answer.serves;
  return answer;
}

}  // namespace railfix::service
