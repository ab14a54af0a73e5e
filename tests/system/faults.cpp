#include "system/faults.hpp"

#include <poll.h>
#include <signal.h>
#include <sys/resource.h>

#include <cmath>
#include <fstream>
#include <random>

#include "core/time.hpp"
#include "messaging/topics.hpp"
#include "train/keys.hpp"

namespace railfix::system_test {
namespace {

namespace fs = std::filesystem;

constexpr int64_t kWrongQosNs = 8 * core::kNsPerSecond;

std::string service_of(const std::string& service_at_host) {
  return service_at_host.substr(0, service_at_host.find('@'));
}

Fault killed(const std::string& service) {
  return {.name = service + " killed",
          .begin = [=](Rig& rig) { rig.send(service, SIGKILL); },
          .end = {},
          .named = service_of(service)};
}

// Somebody must notice that it hangs and start it anew; SIGCONT at the end is for the next fault only.
Fault frozen(const std::string& service) {
  return {.name = service + " frozen",
          .begin = [=](Rig& rig) { rig.send(service, SIGSTOP); },
          .end = [=](Rig& rig) { rig.send(service, SIGCONT); },
          .named = service_of(service)};
}

// No fault: another build of it comes, as `railfix train upgrade` does it.
Fault swapped(const std::string& service) {
  const auto before = std::make_shared<pid_t>(0);
  return {.name = service + " swapped",
          .begin =
              [=](Rig& rig) {
                *before = rig.pid(service);
                rig.swap(service);
              },
          .end = {},
          .over = [=](Rig& rig) { return rig.replaced(service, *before); },
          .lasts_s = 30,
          .watch_s = 5,
          .named = ""};
}

void limit_memory(pid_t pid, rlim_t bytes) {
  const rlimit limit{bytes, RLIM_INFINITY};
  prlimit(pid, RLIMIT_AS, &limit, nullptr);
}

// No more memory than it has now: what asks for more dies, now or seconds later. From then on the train must help
// itself.
Fault short_of_memory(const std::string& service) {
  const auto limited = std::make_shared<pid_t>(0);
  return {.name = service + " gets no more memory",
          .begin =
              [=](Rig& rig) {
                *limited = rig.pid(service);
                size_t pages = 0;
                std::ifstream("/proc/" + std::to_string(*limited) + "/statm") >> pages;
                limit_memory(*limited, pages * 4096);
              },
          .end = [=](Rig& rig) { limit_memory(rig.pid(service), RLIM_INFINITY); },
          .over = [=](Rig&) { return kill(*limited, 0) != 0; },
          .lasts_s = 8,
          .named = ""};
}

/// To the last byte.
void fill(const fs::path& folder) {
  std::ofstream file(folder / "filler", std::ios::binary);
  const std::vector<char> block(1 << 20);
  while (file.write(block.data(), static_cast<std::streamsize>(block.size())).flush()) {
  }
  file.close();
  std::ofstream rest(folder / "filler-rest", std::ios::binary);
  while (rest.write(block.data(), 512).flush()) {
  }
}

Fault full(const std::string& what, const std::function<fs::path(const Rig&)>& folder, const std::string& named) {
  return {.name = what + " full",
          .begin = [=](Rig& rig) { fill(folder(rig)); },
          .end =
              [=](Rig& rig) {
                for (const char* name : {"filler", "filler-rest"}) fs::remove(folder(rig) / name);
              },
          .lasts_s = 8,
          .named = named};
}

Fault cable_cut(double seconds) {
  return {.name = "cable out for " + std::to_string(static_cast<int>(seconds)) + " s",
          .begin = [](Rig& rig) { rig.hosts().plug(false); },
          .end = [](Rig& rig) { rig.hosts().plug(true); },
          .lasts_s = seconds,
          .watch_s = 10,
          .named = ""};
}

void lose_on_cable(Rig& rig, const char* change) {
  for (const auto host : {TwoHosts::cab, TwoHosts::coach}) {
    rig.hosts().on(host, [&] {
      const std::string command = std::string("iptables ") + change + " INPUT -i " + TwoHosts::kInterface[host] +
                                  " -m statistic --mode random --probability 0.1 -j DROP";
      if (std::system(command.c_str()) != 0) throw core::BadInput("iptables is missing: apt-get install iptables");
    });
  }
}

/// Pictures that will be shot in the next `seconds`, beginning in a second (some are decoded ahead).
std::vector<fs::path> next_pictures(const Rig& rig, double seconds) {
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(rig.pictures())) files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  const int64_t first_ns = std::stoll(files.front().stem());
  std::erase_if(files, [&](const fs::path& file) {
    const double at_s = core::seconds(std::stoll(file.stem()) - first_ns);
    return at_s < rig.ridden_s() + 1 || at_s > rig.ridden_s() + 1 + seconds;
  });
  return files;
}

/// `bytes_of` gives what stands in the place of each picture.
Fault bad_pictures(const std::string& what, const std::string& named,
                   const std::function<std::string(const fs::path& first, int number)>& bytes_of) {
  return {.name = "5 s of " + what,
          .begin =
              [=](Rig& rig) {
                const auto files = next_pictures(rig, 5);
                const auto first = fs::read_symlink(files.front());
                int number = 0;
                for (const auto& file : files) {
                  const auto draft = rig.folder() / "draft";
                  std::ofstream(draft, std::ios::binary) << bytes_of(first, number++);
                  fs::rename(draft, file);
                }
              },
          .end = {},
          .lasts_s = 6,
          .named = named};
}

std::string noise(size_t bytes, int seed) {
  std::mt19937 random(static_cast<unsigned>(seed));
  std::string text(bytes, '\0');
  for (char& c : text) c = static_cast<char>(random());
  return text;
}

std::string wrong_qos_profiles(const Rig& rig) {
  std::string xml = messaging::qos_xml();
  const std::string reliable = "<kind>RELIABLE</kind>";
  const size_t at = xml.find(reliable, xml.find("<data_writer profile_name=\"odometry_step\">"));
  xml.replace(at, reliable.size(), "<kind>BEST_EFFORT</kind>");
  const auto file = rig.folder() / "wrong_qos.xml";
  std::ofstream(file) << xml;
  return file.string();
}

/// Lies beside the train; must change nothing.
Fault rogue(const std::string& what, const std::function<std::vector<std::string>(Rig&)>& identity) {
  const auto process = std::make_shared<std::unique_ptr<test::Program>>();
  return {.name = "rogue participant " + what,
          .begin =
              [=](Rig& rig) {
                std::vector<std::string> arguments{"railfix-measure-faults", "--be-rogue", rig.train_id(),
                                                   std::to_string(Rig::kDomain)};
                for (const auto& one : identity(rig)) arguments.push_back(one);
                *process = rig.hosts().on(TwoHosts::cab, [&] { return std::make_unique<test::Program>(arguments); });
              },
          .end = [=](Rig&) { process->reset(); },
          .lasts_s = 6,
          .watch_s = 3,
          .named = ""};
}

fs::path foreign_keys(Rig& rig) {
  const auto train = rig.folder() / "foreign";
  fs::create_directories(train);
  fs::copy_file(rig.folder() / "train/train.yaml", train / "train.yaml", fs::copy_options::overwrite_existing);
  core::value_or_throw(tool::make_keys(core::value_or_throw(tool::read_manifest(train)), {}));
  return train / "security/cab";
}

/// New certificates for all, then each host service by service, as docs/fleet.md says. No fault at all.
Fault certificates_renewed() {
  const auto step = std::make_shared<std::unique_ptr<test::Program>>();
  const auto hosts_left = std::make_shared<std::vector<const char*>>();
  return {.name = "certificates renewed in service",
          .begin =
              [=](Rig& rig) {
                *hosts_left = {"cab", "coach"};
                *step = std::make_unique<test::Program>(
                    std::vector<std::string>{"railfix", "train", "keys", (rig.folder() / "train").string(), "--renew"});
              },
          .end = {},
          .over =
              [=](Rig& rig) {
                const auto code = (*step)->exit_code();
                if (!code) return false;
                if (*code != 0) throw std::runtime_error("certificates could not be renewed");
                if (hosts_left->empty()) return true;
                const std::string host = hosts_left->back();
                hosts_left->pop_back();
                *step = rig.hosts().on(Rig::host_of(host), [&] {
                  return std::make_unique<test::Program>(std::vector<std::string>{
                      "railfix", "train", "upgrade", (rig.folder() / "train").string(), "--host", host, "--root",
                      rig.root(host).string(), "--healthy-for", "2"});
                });
                return false;
              },
          .lasts_s = 300,
          .named = ""};
}

/// Over when the mended one has taken its place: until then, as in every swap, the wrong one goes on.
Fault other_quality_of_service(const std::string& service) {
  const auto mended_ns = std::make_shared<int64_t>(0);
  const auto wrong = std::make_shared<pid_t>(0);
  return {.name = service_of(service) + " with another quality of service",
          .begin =
              [=](Rig& rig) {
                *mended_ns = core::monotonic_ns() + kWrongQosNs;
                *wrong = 0;
                rig.set_arguments(service, {"--set", "common.qos_profiles=" + wrong_qos_profiles(rig)});
              },
          .end = {},
          .over =
              [=](Rig& rig) {
                if (core::monotonic_ns() < *mended_ns) return false;
                if (*wrong == 0) {
                  *wrong = rig.pid(service);
                  rig.set_arguments(service, {});
                }
                return rig.replaced(service, *wrong);
              },
          .lasts_s = 60,
          .named = "quality of service"};
}

void clock_steps(std::vector<Fault>& table) {
  for (const char* host : {"cab", "coach"}) {
    for (const double seconds : {5.0, -5.0}) {
      // The played camera follows the cab's clock, as a real one does not: there only small steps say something.
      const double step_s = std::string(host) == "cab" ? seconds / 20 : seconds;
      char name[64];
      std::snprintf(name, sizeof name, "clock of %s steps by %+.2f s", host, step_s);
      table.push_back({.name = name,
                       .begin = [=](Rig& rig) { rig.step_clock(host, step_s); },
                       .end = [=](Rig& rig) { rig.step_clock(host, 0); },
                       .lasts_s = 8,
                       .named = "clock"});
    }
  }
}

}  // namespace

std::vector<Fault> fault_table(const Rig& rig) {
  std::vector<Fault> table;
  for (const auto& service : rig.services()) table.push_back(killed(service));
  for (const auto& service : rig.services()) table.push_back(frozen(service));
  for (const auto& service : rig.services()) table.push_back(swapped(service));
  for (const auto& service : rig.services()) table.push_back(short_of_memory(service));
  table.push_back(full(
      "disk of cab", [](const Rig& r) { return r.root("cab"); }, "disk"));
  table.push_back(full(
      "disk of coach", [](const Rig& r) { return r.root("coach"); }, "disk"));
  table.push_back(full(
      "/dev/shm", [](const Rig&) { return fs::path("/dev/shm"); }, "/dev/shm"));
  for (const double seconds : {1.0, 10.0, 60.0}) table.push_back(cable_cut(seconds));
  table.push_back({.name = "cable loses 10 %",
                   .begin = [](Rig& r) { lose_on_cable(r, "-A"); },
                   .end = [](Rig& r) { lose_on_cable(r, "-D"); },
                   .lasts_s = 15,
                   .named = ""});
  table.push_back({.name = "coach without power for 10 s",
                   .begin = [](Rig& r) { r.cut_power("coach"); },
                   .end = [](Rig& r) { r.power_on("coach"); },
                   .lasts_s = 10,
                   .watch_s = 15,
                   .named = "silent"});
  table.push_back({.name = "supervisor of cab killed",
                   .begin = [](Rig& r) { r.kill_supervisor("cab"); },
                   .end = [](Rig& r) { r.power_on("cab"); },  // systemd does so after RestartSec; services live on
                   .lasts_s = 1,
                   .watch_s = 15,
                   .named = ""});
  clock_steps(table);
  table.push_back(bad_pictures("broken picture files", "picture", [](const auto&, int n) { return noise(5000, n); }));
  table.push_back(
      bad_pictures("the same picture", "frozen", [](const auto& first, int) { return test::slurp(first); }));
  table.push_back(
      bad_pictures("noise", "", [](const auto&, int n) { return "P5\n640 512\n255\n" + noise(640 * 512, n); }));
  if (rig.options().security) {
    table.push_back(rogue("without certificate", [](Rig&) { return std::vector<std::string>{"fusion"}; }));
    table.push_back(rogue("of another train's authority", [](Rig& r) {
      return std::vector<std::string>{"fusion", foreign_keys(r).string()};
    }));
  }
  table.push_back(other_quality_of_service("odometry@cab"));
  if (rig.options().security) table.push_back(certificates_renewed());
  for (auto& fault : table) {
    for (const char* name :
         {"odometry@cab killed", "cable out for 1 s", "rogue participant of another train's authority"})
      fault.in_short = fault.in_short || fault.name == name;
  }
  return table;
}

int be_rogue(const std::string& train_id, int64_t domain, const std::string& service, const std::string& keys) {
  messaging::ParticipantOptions options;
  options.train_id = train_id;
  options.domain = domain;
  options.service = service;
  options.security_folder = keys;
  messaging::Participant participant(options);
  messaging::Writer<msg::TrainState> writer(participant, messaging::topics::train_state);
  msg::TrainState lie;
  lie.edge(1);
  lie.track_known(1);
  lie.track_probability(1);
  while (true) {
    lie.stamp_ns(core::wall_ns());
    writer.write(lie);
    poll(nullptr, 0, 20);
  }
}

}  // namespace railfix::system_test
