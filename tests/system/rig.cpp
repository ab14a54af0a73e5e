#include "system/rig.hpp"

#include <sched.h>
#include <signal.h>
#include <sys/mount.h>

#include <cstdlib>
#include <iostream>

#include "core/time.hpp"
#include "train/keys.hpp"
#include "train/roll_out.hpp"

namespace railfix::system_test {

namespace fs = std::filesystem;

namespace {

constexpr const char* kHosts[] = {"cab", "coach"};
constexpr const char* kMosquitto = "/usr/sbin/mosquitto";
constexpr const char* kStart = "1:100:+";
constexpr int64_t kRootMb = 500;                      // check asks for 400: the quota below, the store of reports, logs
constexpr int64_t kStartNs = 6 * core::kNsPerSecond;  // so that the first pictures are heard

void mount_memory(const fs::path& at, int64_t mb) {
  fs::create_directories(at);
  const std::string size = "size=" + std::to_string(mb) + "m";
  if (mount("tmpfs", at.c_str(), "tmpfs", 0, size.c_str()) != 0)
    throw core::BadInput("a tmpfs cannot be mounted on " + at.string() + "; this command needs root");
}

}  // namespace

bool enter_own_mounts(int64_t shared_memory_mb) {
  if (unshare(CLONE_NEWNS) != 0) return false;
  if (mount("none", "/", nullptr, MS_REC | MS_PRIVATE, nullptr) != 0) return false;
  mount_memory("/dev/shm", shared_memory_mb);
  return true;
}

Rig::Rig(const RigOptions& options)
    : options_(options),
      train_id_("faults-" + std::to_string(getpid())),
      folder_(fs::temp_directory_path() / train_id_),
      hosts_(std::make_unique<TwoHosts>()) {
  if (!hosts_->ready()) throw core::BadInput("two network namespaces need root and the program ip (iproute2)");
  for (const char* host : kHosts) mount_memory(root(host), kRootMb);
  if (options_.break_pictures) copy_ride();
}

Rig::~Rig() {
  stop();
  for (const char* host : kHosts) umount2(root(host).c_str(), MNT_DETACH);
  std::error_code ignored;
  fs::remove_all(folder_, ignored);
}

// Faults of the camera break pictures: in a copy whose files are the recording's own until then.
void Rig::copy_ride() {
  const auto copy = folder_ / "ride";
  for (const auto& entry : fs::recursive_directory_iterator(options_.ride)) {
    const auto there = copy / fs::relative(entry.path(), options_.ride);
    if (entry.is_directory()) {
      fs::create_directories(there);
    } else {
      fs::create_directories(there.parent_path());
      fs::create_symlink(entry.path(), there);
    }
  }
}

void Rig::write_manifest() {
  const auto train = folder_ / "train";
  fs::create_directories(train);
  fs::copy_file(options_.ride / "map/line.map", train / "line.map", fs::copy_options::overwrite_existing);
  const auto both = [&](const char* first, const char* second) {
    return options_.standby ? std::string("{ host: ") + first + ", standby: " + second + " }" : std::string(first);
  };
  const std::string ride = played().string();
  std::ofstream(train / "train.yaml")
      << "train:\n  id: " << train_id_ << "\n  domain: " << kDomain << "\n  release: " << RAILFIX_VERSION
      << "\n  run_as: programs\n  security: " << (options_.security ? "true" : "false") << "\n  map: line.map\n"
      << "  hosts:\n    cab: { address: 10.42.1.11 }\n    coach: { address: 10.42.1.12 }\n"
      << "  services:\n    frame_grabber: cab\n    sensor_gateway: cab\n    track_detector: cab\n    odometry: cab\n"
      << "    map_matcher: cab\n    fusion: " << both("coach", "cab") << "\n    tpr_publisher: " << both("coach", "cab")
      << "\n    recorder: cab\n    monitor: coach\n"
      << "settings:\n  frame_grabber: { source: " << ride
      << ", start: immediately, preview_hz: 1, began_s: " << std::to_string(core::seconds(began_ns_)) << " }\n"
      << "  sensor_gateway: { source: " << ride << " }\n  fusion: { start: \"" << kStart << "\" }\n"
      << "  tpr_publisher: { nid_engine: 460042, t_cycloc_s: 1, ground_link: { broker: \"" << kBroker
      << "\", store: reports.db } }\n"
      << "  recorder: { folder: recordings, keep_free_mb: 20, quota_mb: 150, split_mb: 50, picture_every: "
      << options_.picture_every << " }\n"
      << "  monitor: { port: " << kMonitorPort << ", port_search: 0, foxglove_port: -1 }\n";
}

// In the coach, where the radio is.
void Rig::start_broker() {
  if (!fs::exists(kMosquitto)) return;
  std::ofstream(folder_ / "broker.conf") << "listener 1883 10.42.1.12\nallow_anonymous true\nuser root\n"
                                         << "max_queued_messages 0\nmax_inflight_messages 0\n";
  broker_ = hosts_->on(TwoHosts::coach, [&] {
    return std::make_unique<test::Program>(
        std::vector<std::string>{kMosquitto, "-c", (folder_ / "broker.conf").string()},
        test::Program::Options{folder_ / "broker.log", {}, {}});
  });
}

void Rig::prepare() {
  write_manifest();
  const auto manifest = core::value_or_throw(tool::read_manifest(folder_ / "train"));
  if (options_.security) core::value_or_throw(tool::make_keys(manifest, {}));
  for (const char* host : kHosts) {
    const tool::HostFolder place(root(host));
    fs::remove(place.plan_file());  // what runs unchanged would keep its old files
    core::ok_or_throw(place.write(core::value_or_throw(tool::install(manifest, *manifest.host(host), root(host)))));
    // Two clients of a broker with the same name throw each other out.
    if (options_.standby)
      set_arguments(std::string("tpr_publisher@") + host,
                    {"--set", "tpr_publisher.ground_link.client_id=" + train_id_ + "-" + host});
  }
}

void Rig::depart() {
  stop();
  if (!broker_) start_broker();
  began_ns_ = core::wall_ns() + kStartNs;
  prepare();
  for (const char* host : kHosts) {
    step_clock(host, 0);
    power_on(host);
  }
}

// The next fusion that starts here does not know where the train is by then.
void Rig::forget_start() const {
  for (const char* host : kHosts) {
    const tool::HostFolder place(root(host));
    const auto file = place.generation(place.newest_generation()) / "config.yaml";
    std::string text = test::slurp(file);
    const size_t at = text.find(kStart);
    if (at == std::string::npos) continue;
    text.replace(at, std::string(kStart).size(), "unknown");
    std::ofstream(file) << text;
  }
}

void Rig::power_on(const std::string& host) {
  setenv("LD_PRELOAD", (fs::path(RAILFIX_BIN_DIR) / "railfix-clock-step.so").c_str(), 1);
  setenv("RAILFIX_CLOCK_STEP", clock_file(host).c_str(), 1);
  supervisors_[host] = hosts_->on(host_of(host), [&] {
    return std::make_unique<test::Program>(
        std::vector<std::string>{"railfix", "train", "supervise", "--root", root(host).string()},
        test::Program::Options{folder_ / (host + ".log"), {}, {}});
  });
  unsetenv("LD_PRELOAD");
  hosts_->plug(true);
}

void Rig::cut_power(const std::string& host) {
  hosts_->plug(false);
  kill_supervisor(host);
  kill_services(host);
}

// What a supervisor that was killed has left.
void Rig::kill_services(const std::string& host) const {
  for (const auto& [name, service] : tool::HostFolder(root(host)).state()) {
    if (service.pid > 0) kill(static_cast<pid_t>(service.pid), SIGKILL);
  }
}

void Rig::kill_supervisor(const std::string& host) {
  supervisors_.at(host)->end(SIGKILL);
}

void Rig::stop() {
  for (auto& [host, supervisor] : supervisors_) supervisor->send(SIGTERM);
  for (auto& [host, supervisor] : supervisors_) {
    supervisor->wait_for_end();
    kill_services(host);
  }
  supervisors_.clear();
}

double Rig::ridden_s() const {
  return core::seconds(core::wall_ns() - began_ns_);
}

std::vector<std::string> Rig::services() const {
  std::vector<std::string> names;
  for (const char* host : kHosts) {
    const auto plan = tool::HostFolder(root(host)).plan();
    if (!plan) continue;
    for (const auto& service : plan->services) names.push_back(service.name + "@" + host);
  }
  return names;
}

tool::RunningService Rig::running(const std::string& service_at_host) const {
  const size_t at = service_at_host.find('@');
  const auto state = tool::HostFolder(root(service_at_host.substr(at + 1))).state();
  const auto found = state.find(service_at_host.substr(0, at));
  return found == state.end() ? tool::RunningService{} : found->second;
}

pid_t Rig::pid(const std::string& service_at_host) const {
  return static_cast<pid_t>(running(service_at_host).pid);
}

bool Rig::replaced(const std::string& service_at_host, pid_t before) const {
  const auto now = running(service_at_host);
  return now.pid > 0 && now.pid != before && !now.beside;
}

void Rig::send(const std::string& service_at_host, int signal) const {
  if (const pid_t one = pid(service_at_host); one > 0) kill(one, signal);
}

void Rig::swap(const std::string& service_at_host) const {
  const size_t at = service_at_host.find('@');
  const tool::HostFolder place(root(service_at_host.substr(at + 1)));
  auto plan = place.plan();
  for (auto& service : plan->services) {
    if (service.name == service_at_host.substr(0, at)) service.settings += "swapped\n";
  }
  core::ok_or_throw(place.write(*plan));
}

void Rig::set_arguments(const std::string& service_at_host, const std::vector<std::string>& arguments) const {
  const size_t at = service_at_host.find('@');
  const tool::HostFolder place(root(service_at_host.substr(at + 1)));
  auto plan = place.plan();  // what was swapped stays so
  const auto as_installed = place.plan(place.newest_generation());
  for (const auto& usual : as_installed->services) {
    if (usual.name != service_at_host.substr(0, at)) continue;
    for (auto& service : plan->services) {
      if (service.name != usual.name) continue;
      service.command = usual.command;
      service.command.insert(service.command.end(), arguments.begin(), arguments.end());
    }
  }
  core::ok_or_throw(place.write(*plan));
}

fs::path Rig::keys() const {
  return options_.security ? folder_ / "train/security/cab" : fs::path();
}

fs::path Rig::keep_evidence() const {
  const auto there = folder_.parent_path() / (train_id_ + "-at-" + std::to_string(static_cast<int>(ridden_s())) + "s");
  for (const char* host : kHosts) {
    fs::create_directories(there / host);
    const tool::HostFolder place(root(host));
    for (const auto& folder : {place.home() / "recordings", place.log("any").parent_path()}) {
      if (fs::exists(folder)) fs::copy(folder, there / host / folder.filename(), fs::copy_options::recursive);
    }
  }
  return there;
}

void Rig::step_clock(const std::string& host, double seconds) const {
  const int64_t step_ns = core::to_ns(seconds);
  const int file = open(clock_file(host).c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0644);
  if (pwrite(file, &step_ns, sizeof step_ns, 0) != sizeof step_ns) throw std::runtime_error("no clock file");
  close(file);
}

}  // namespace railfix::system_test
